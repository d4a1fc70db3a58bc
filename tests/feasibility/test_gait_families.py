"""Near-duplicates are one family however they are named, and copies change nobody else's weight."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.augment.mirror import time_scale_clip
from pipeline.feasibility import CommandSettings, FeasibilitySettings, balance, coverage
from pipeline.feasibility.gait_signature import gait_signature, gait_signature_text
from pipeline.files import settings
from pipeline.robot import load_robot
from pipeline.robot.mirror_image import mirror_clip
from tests.factories.robot_clips import standing

ROOT = Path(__file__).resolve().parents[2]
LIMITS = settings.read(ROOT / "data" / "feasibility.yaml", FeasibilitySettings)
COMMANDS = settings.read(ROOT / "data" / "commands.yaml", CommandSettings)
SAME = LIMITS.balance.same_gait
T1 = load_robot("t1")


def gait(seed: int, seconds: float = 3.0):
    """Joints that swing in turns, each by its own amount and about its own middle."""
    rng, clip = np.random.default_rng(seed), standing(T1, seconds=seconds)
    time_s = np.arange(clip.frame_count) / clip.fps
    swing = rng.uniform(0.0, 0.3, size=clip.joint_pos.shape[1])
    middle = clip.joint_pos + rng.normal(0.0, 0.1, size=swing.shape)
    phase = rng.uniform(0.0, 2.0 * np.pi, size=swing.shape)
    return dataclasses.replace(clip, joint_pos=middle + swing * np.sin(2.0 * np.pi * time_s[:, None] + phase))


def row(name: str, clip, forward: float = 0.5, yaw: float = 0.0, **more) -> dict:
    velocity = {"forward_m_s": forward, "lateral_m_s": 0.0, "yaw_rate_rad_s": yaw, "root_jerk": 50.0}
    said = {"clip": name, "seconds": clip.duration_s, "gait_signature": gait_signature_text(clip, T1)}
    return {**said, **velocity, **more}


def balanced(rows: list[dict]) -> pd.DataFrame:
    return balance(pd.DataFrame(rows), LIMITS.balance, COMMANDS).set_index("clip")


def distance(a, b) -> float:
    return float(np.sqrt(np.mean((gait_signature(a, T1) - gait_signature(b, T1)) ** 2)))


def test_a_mirror_another_place_and_another_speed_leave_the_signature_and_another_gait_does_not():
    clip = gait(1)
    moved = dataclasses.replace(clip, root_pos_w=clip.root_pos_w + np.array([3.0, -2.0, 0.0]))
    for same in (mirror_clip(clip, T1, "mirrored"), moved, time_scale_clip(clip, 1.1, "faster")):
        assert distance(clip, same) < 0.2 * SAME
    assert distance(clip, gait(2)) > 3.0 * SAME


def test_a_later_stretch_of_a_steady_gait_is_the_same_gait():
    clip = gait(1, seconds=6.0)
    assert distance(clip.cut(0, 120, "early"), clip.cut(150, 290, "late")) < SAME


def test_a_recording_mirrored_by_whoever_made_it_shares_the_weight_of_its_original():
    clip, other = gait(1), gait(2)
    names = {"walk": clip, "walk_mirror": mirror_clip(clip, T1, "walk_mirror"), "other": other}
    found = balanced([row(name, each) for name, each in names.items()])
    assert found["family"].to_dict() == {"walk": "walk", "walk_mirror": "walk", "other": "other"}
    assert found["weight"]["walk"] + found["weight"]["walk_mirror"] == pytest.approx(found["weight"]["other"])


@pytest.mark.parametrize("copies", [1, 2, 7])
def test_copies_of_a_clip_leave_its_familys_total_and_all_other_weights(copies):
    clips = {f"gait {seed}": gait(seed) for seed in range(4)}
    before = balanced([row(name, clip) for name, clip in clips.items()])
    noisy = [
        dataclasses.replace(clips["gait 0"], joint_pos=clips["gait 0"].joint_pos + 0.001 * copy)
        for copy in range(1, copies + 1)
    ]
    rows = [row(name, clip) for name, clip in clips.items()]
    rows += [row(f"copy {copy}", clip) for copy, clip in enumerate(noisy)]
    after = balanced(rows)
    part_before, part_after = before["weight"] / before["weight"].sum(), after["weight"] / after["weight"].sum()
    assert part_after.groupby(after["family"]).sum().max() == pytest.approx(0.25)
    assert part_after[after["family"] == after["family"]["gait 0"]].sum() == pytest.approx(part_before["gait 0"])
    for name in ("gait 1", "gait 2", "gait 3"):
        assert part_after[name] == pytest.approx(part_before[name])


def test_the_same_gait_in_another_cell_has_that_cells_weight():
    found = balanced([row("straight", gait(1)), row("curve", mirror_clip(gait(1), T1, "curve"), yaw=1.0)])
    assert found["family"].nunique() == 1
    assert found["weight"]["straight"] == pytest.approx(found["weight"]["curve"])


def test_a_time_scaled_copy_that_falls_into_another_cell_counts_there():
    clip = gait(1)
    rows = [
        row("walk", clip, 0.55),
        row("quick", time_scale_clip(clip, 1.5, "quick"), 0.55 * 1.5),
        row("b", gait(2), 0.55),
    ]
    found = balanced(rows)
    assert found["weight"]["quick"] == pytest.approx(found["weight"]["walk"] + found["weight"]["b"])


def test_clips_without_a_signature_are_told_by_their_parents_alone():
    rows = [row("a", gait(1)), row("b", gait(1))]
    found = balanced([{**each, "gait_signature": None} for each in rows])
    assert found["family"].to_dict() == {"a": "a", "b": "b"}


def test_a_cell_reports_its_effective_seconds_before_and_after():
    clips = [("a", gait(1)), *((f"a copy {copy}", gait(1)) for copy in range(4)), ("b", gait(2))]
    rows = balance(pd.DataFrame([row(name, clip) for name, clip in clips]), LIMITS.balance, COMMANDS)
    cells = coverage(rows, LIMITS.balance, COMMANDS).cells
    (cell,) = cells[(cells["axis"] == "forward") & np.isclose(cells["low"], 0.4)].to_dict("records")
    assert (cell["clips"], cell["families"], cell["seconds"]) == (6, 2, pytest.approx(18.0))
    assert cell["effective_seconds_before"] == pytest.approx(3.0 * 36.0 / 26.0)
    assert cell["effective_seconds"] == pytest.approx(6.0)


def test_turns_that_no_walk_makes_are_said():
    spent = [[forward, 0.05, yaw, 3.0] for forward in np.arange(-0.55, 2.0, 0.1) for yaw in (-0.2, 0.2)]
    spent += [[0.45, 0.05, 0.7, 3.0], [0.65, 0.05, 0.7, 3.0], [0.45, 0.05, 1.2, 3.0]]
    one = row("all", gait(1), command_seconds=json.dumps(spent), seconds=3.0 * len(spent))
    said = coverage(pd.DataFrame([{**one}]), LIMITS.balance, COMMANDS).missing
    assert "No clip that goes forward at 0.6 to 0.8 m/s turns left faster than 1 rad/s." in said
    assert "No clip that goes forward at 0.8 to 2 m/s turns left faster than 0.5 rad/s." in said
    assert "No clip that goes forward at 0 to 2 m/s turns right faster than 0.5 rad/s." in said
    for side in ("left", "right"):
        assert f"No clip that goes back at 0 to 0.6 m/s turns {side} faster than 0.5 rad/s." in said
    assert not any("0.4 to 0.6" in sentence and "left" in sentence for sentence in said)
