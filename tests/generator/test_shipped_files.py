"""The committed files: what the generator makes, the truth, the skills they hold, the defects planted in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from pipeline import time_series
from pipeline.clips.human_clip import BODIES, HumanClip
from pipeline.generator import RECIPES
from pipeline.generator import recipes as recipes_module
from pipeline.generator.__main__ import main
from pipeline.generator.recipes import DEFECTS
from pipeline.generator.skeleton import JOINT_OF_BODY
from tests.factories.generated import parse_bvh, shipped, spoilt

SKILLS = {"stand", "turn_left", "turn_right", "side_left", "side_right", "back", "walk_slow", "walk"}
SKILLS |= {"walk_fast_jog", "run"}
ROBOT_SPEED = 0.583  # what retargeting scales this person to the T1 by


def folder(root: Path) -> Path:
    return root / "data" / "motions"


def sidecar(root: Path, name: str) -> dict:
    return yaml.safe_load((folder(root) / f"{name}.yaml").read_text())


def measured_speeds(clip: HumanClip) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Forward, lateral and yaw rate: root smoothed over .2 s, facing from the hip line over .5 s."""
    velocity = time_series.moving_mean(time_series.derivative(clip.pos("pelvis"), clip.fps), 13)
    hips = clip.pos("left_hip") - clip.pos("right_hip")
    heading = time_series.moving_mean(np.unwrap(np.arctan2(-hips[:, 0], hips[:, 1])), 31)
    forward = np.cos(heading) * velocity[:, 0] + np.sin(heading) * velocity[:, 1]
    lateral = np.cos(heading) * velocity[:, 1] - np.sin(heading) * velocity[:, 0]
    return forward, lateral, time_series.derivative(heading, clip.fps)


def measured_skills(clip: HumanClip) -> dict[str, float]:
    """Seconds of each skill in stretches of .8 s and more, by the definitions of the project's requirements."""
    forward, lateral, turn = measured_speeds(clip)
    names = []
    for ahead, left, rate in zip(forward, lateral, turn, strict=True):
        speed = np.hypot(ahead, left)
        if speed < 0.15 and abs(rate) < np.deg2rad(20.0):
            names.append("stand")
        elif speed < 0.35 and abs(rate) > np.deg2rad(30.0):
            names.append("turn_left" if rate > 0.0 else "turn_right")
        elif abs(left) > 1.2 * abs(ahead):
            names.append("side_left" if left > 0.0 else "side_right")
        elif ahead < 0.0:
            names.append("back")
        else:
            names.append(next(n for n, top in FORWARD if ahead < top))
    seconds = {}
    for skill in set(names):
        lengths = [stop - start for start, stop in time_series.runs(np.array(names) == skill)]
        seconds[skill] = sum(length for length in lengths if length >= 0.8 * clip.fps) / clip.fps
    return seconds


FORWARD = (("walk_slow", 0.6), ("walk", 1.3), ("walk_fast_jog", 2.0), ("run", np.inf))


def test_the_committed_files_are_what_the_generator_makes_byte_for_byte(root):
    made = dict(recipes_module.texts())
    there = {path.name for path in folder(root).iterdir()}
    assert there == set(made)
    for name, text in made.items():
        assert (folder(root) / name).read_text() == text, name
    assert sum(map(len, made.values())) < 8e6


def test_the_command_writes_a_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(recipes_module, "texts", lambda: iter([("a.bvh", "one"), ("README.md", "two")]))
    main([str(tmp_path / "out")])
    assert (tmp_path / "out" / "a.bvh").read_text() == "one"
    assert "README.md" in capsys.readouterr().out


@pytest.mark.parametrize("name", sorted(RECIPES))
def test_a_bvh_file_is_the_truth_to_a_fifth_of_a_millimetre(name):
    made = shipped(name)
    file = parse_bvh(made.bvh)
    assert file.fps == pytest.approx(made.clip.fps, rel=1e-6)
    for index, body in enumerate(BODIES):
        position = file.positions[JOINT_OF_BODY[body]][:, [2, 0, 1]]  # the file's (left, up, ahead)
        assert np.abs(position - made.clip.body_pos_w[:, index]).max() < 2e-4


def test_a_person_at_rest_is_a_t_of_human_size_facing_z():
    text = shipped("stand").bvh
    head, _, motion = text.partition("MOTION\n")
    width = len(motion.splitlines()[2].split())
    rest = parse_bvh(f"{head}MOTION\nFrames: 1\nFrame Time: 0.02\n{' '.join(['0'] * width)}\n").positions
    assert rest["LeftHand"][0, 0] > 0.7
    assert rest["LeftHand"][0, 1] == pytest.approx(rest["LeftArm"][0, 1])
    assert rest["LeftToe"][0, 2] > 0.1
    assert 0.84 < rest["LeftUpLeg"][0, 1] - rest["LeftFoot"][0, 1] < 0.88  # .491 of 1.75 m (Winter 2009)


def test_every_skill_is_there_for_five_seconds_and_as_the_sidecars_say(root):
    total = dict.fromkeys(SKILLS, 0.0)
    for name in RECIPES:
        measured = measured_skills(shipped(name).clip)
        for skill, seconds in sidecar(root, name)["expect"]["skills"].items():
            assert measured[skill] == pytest.approx(seconds, abs=0.5)
            total[skill] += measured[skill]
    assert min(total.values()) >= 5.0, total


def test_the_robot_s_command_range_is_covered_at_its_speed():
    speeds = [measured_speeds(shipped(name).clip) for name in RECIPES]
    forward, lateral, turn = (np.concatenate(part) for part in zip(*speeds, strict=True))
    ahead = np.sort(ROBOT_SPEED * forward)
    assert ahead[0] < -0.6
    assert ahead[-1] > 2.0
    inside = ahead[(ahead > -0.6) & (ahead < 2.0)]
    counts, _ = np.histogram(inside, np.linspace(-0.6, 2.0, 14))
    assert counts.min() >= 60  # a second in every .2 m/s
    assert np.diff(inside).max() < 0.17
    assert ROBOT_SPEED * lateral.min() < -0.6
    assert ROBOT_SPEED * lateral.max() > 0.6
    assert turn.min() < -1.5
    assert turn.max() > 1.5


@pytest.mark.parametrize("name", sorted(DEFECTS))
def test_a_sidecar_names_the_fate_and_every_reason(root, name):
    side = sidecar(root, name)
    codes = {fault["code"] for fault in side["defects"]}
    assert codes == set(side["expect"]["reasons"]) | set(side["expect"]["repaired"])
    assert codes <= {"teleport", "dropout", "frozen", "time_base", "foot_skate"}
    assert side["expect"]["fate"] in ("accepted", "partly", "rejected")
    assert side["licence"] == "CC0-1.0"


def fault_frames(root: Path, name: str, fps: float) -> list[slice]:
    return [slice(round(f["start_s"] * fps), round(f["stop_s"] * fps)) for f in sidecar(root, name)["defects"]]


def test_limbs_drop_out_where_the_sidecar_says_and_nowhere_else(root):
    file = parse_bvh(spoilt("defect_dropout"))
    short, long = fault_frames(root, "defect_dropout", file.fps)
    for joint, frames in (("RightArm", short), ("LeftUpLeg", long)):
        zero = (file.angles_deg[joint] == 0.0).all(axis=1)
        assert zero[frames].all()
        assert zero.sum() == frames.stop - frames.start
    assert (short.stop - short.start) / file.fps == pytest.approx(0.0833, abs=1e-3)
    assert (long.stop - long.start) / file.fps == pytest.approx(0.6)


def test_the_root_jumps_by_60_cm_where_the_sidecar_says(root):
    file = parse_bvh(spoilt("defect_teleport"))
    (frames,) = fault_frames(root, "defect_teleport", file.fps)
    steps = np.linalg.norm(np.diff(file.positions["Hips"], axis=0), axis=1)
    assert steps.argmax() == frames.start - 1
    assert steps.max() == pytest.approx(0.6, abs=0.03)
    assert np.sort(steps)[-2] < 0.03


def test_the_tail_is_frozen_where_the_sidecar_says(root):
    file = parse_bvh(spoilt("defect_frozen"))
    (frames,) = fault_frames(root, "defect_frozen", file.fps)
    hips = file.positions["Hips"]
    assert (hips[frames.start :] == hips[-1]).all()
    assert (np.abs(np.diff(hips[: frames.start + 1], axis=0)).max(axis=1) > 1e-3).all()
    assert len(hips) / file.fps - frames.start / file.fps == pytest.approx(1.5, abs=0.05)


def test_only_the_true_rate_makes_the_run_fall_with_gravity(root):
    side, file = sidecar(root, "defect_time_base"), parse_bvh(spoilt("defect_time_base"))
    assert file.fps == pytest.approx(side["declared_fps"])
    lowest = np.minimum(file.positions["LeftToe"][:, 1], file.positions["RightToe"][:, 1])
    flight = lowest > 0.045  # toe joint 2 cm above where it stands
    inside = flight[2:] & flight[1:-1] & flight[:-2]
    curvature = np.diff(file.positions["Hips"][:, 1], 2)[inside].mean()
    assert curvature * side["true_fps"] ** 2 == pytest.approx(-9.81, rel=0.02)
    assert curvature * side["declared_fps"] ** 2 == pytest.approx(-0.43, abs=0.02)


def test_standing_feet_skate_by_30_cm_a_second():
    file = parse_bvh(spoilt("defect_foot_skate"))
    for side in ("Left", "Right"):
        toe = file.positions[f"{side}Toe"]
        standing = (toe[1:, 1] < 0.0255) & (toe[:-1, 1] < 0.0255)
        speed = np.linalg.norm(np.diff(toe[:, [0, 2]], axis=0), axis=1)[standing] * file.fps
        assert standing.mean() > 0.3
        assert np.median(speed) == pytest.approx(0.3, abs=0.01)
