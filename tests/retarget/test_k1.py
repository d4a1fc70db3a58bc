"""The K1 meets the T1's retargeting bars with the T1's settings."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline.cli.chain import Chain
from pipeline.clips.robot_clip import RobotClip
from pipeline.files import settings as settings_file
from pipeline.project import Project
from pipeline.readers import Statement
from pipeline.retarget import RetargetSettings, process
from pipeline.retarget.robot_body import measure
from pipeline.robot import Robot, load_robot
from tests.factories.human_clips import walker
from tests.factories.retarget_clips import mirrored


@pytest.fixture(scope="module")
def k1() -> Robot:
    return load_robot("k1")


def retargeted(root: Path, path: Path, robot: Robot) -> tuple[RobotClip, dict]:
    """The longest piece of a file on a robot, and its numbers."""
    chain = Chain(Project(root))
    pieces = []
    for whole in chain.catalogued(chain.read(path, Statement())).pieces:
        for piece in chain.repaired(whole).pieces:
            pieces += chain.retargeted(piece, whole.numbers, robot).pieces
    longest = max(pieces, key=lambda piece: piece.clip.frame_count)
    assert isinstance(longest.clip, RobotClip)
    return longest.clip, dict(longest.numbers)


def assert_within_limits(clip: RobotClip, robot: Robot) -> None:
    assert (clip.joint_pos >= robot.joint_lower).all()
    assert (clip.joint_pos <= robot.joint_upper).all()
    speed = np.abs(np.diff(clip.joint_pos, axis=0)) * clip.fps
    assert (speed <= robot.retarget_speed_limit).all()


@pytest.mark.parametrize("name", ["walk", "back", "side_left", "turn_left"])
def test_shipped_motions_hold_the_bars(root: Path, k1: Robot, name: str):
    clip, numbers = retargeted(root, root / "data" / "motions" / f"{name}.bvh", k1)
    assert clip.robot == "k1"
    assert_within_limits(clip, k1)
    assert numbers["slip_strict_m_s"] <= 0.012
    assert numbers["penetration_m"] <= 0.015
    assert numbers["limb_error_deg"] <= 3.0


def test_mirrored_people_give_mirrored_robots_without_a_waist(root: Path, k1: Robot):
    """The angle of a waist was the target of the last joint, the right ankle's roll."""
    read = settings_file.read(root / "data/retarget.yaml", RetargetSettings)
    human = walker(seconds=4.0)
    first, second = (
        process(clip, {}, settings=read, robot=k1).pieces[0].clip.joint_pos for clip in (human, mirrored(human))
    )
    assert np.abs(second - k1.mirror_sign * first[:, k1.mirror_index]).max() < 0.02


def test_the_waist_is_the_joint_that_turns_pelvis_against_trunk(k1: Robot):
    t1 = load_robot("t1")
    assert measure(k1).waist is None
    assert (measure(t1).waist, measure(t1).waist_sign) == (t1.joint("Waist"), 1.0)
    on_pelvis = dataclasses.replace(t1, human={**t1.human, "pelvis": "Trunk", "trunk": "Waist"})
    assert (measure(on_pelvis).waist, measure(on_pelvis).waist_sign) == (t1.joint("Waist"), -1.0)
    rigid = dataclasses.replace(t1, controlled=tuple(name for name in t1.controlled if name != "Waist"))
    assert measure(rigid).waist is None


@pytest.mark.shared
def test_lafan1_holds_the_bars_on_average(root: Path, k1: Robot, mocap: Path):
    files = sorted((mocap / "lafan1_60fps").glob("*.bvh"))
    assert len(files) == 13
    found = [retargeted(root, path, k1) for path in files]
    for clip, _ in found:
        assert_within_limits(clip, k1)
    frames = np.array([clip.frame_count for clip, _ in found])
    slip, limbs = (
        float(np.average([numbers[name] for _, numbers in found], weights=frames))
        for name in ("slip_strict_m_s", "limb_error_deg")
    )
    assert slip <= 0.012
    assert limbs <= 3.0
    assert max(numbers["penetration_m"] for _, numbers in found) <= 0.015
