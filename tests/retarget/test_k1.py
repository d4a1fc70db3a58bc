"""The K1 meets the T1's retargeting bars with the T1's settings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.cli.chain import Chain
from pipeline.clips.robot_clip import RobotClip
from pipeline.project import Project
from pipeline.readers import Statement
from pipeline.robot import Robot, load_robot


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
