"""Shares of a short clip: as many bad frames as in two seconds, but never most of its own."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from pipeline.clips.robot_clip import RobotClip
from pipeline.feasibility import FeasibilitySettings, assess
from pipeline.feasibility.criterion import Verdict
from pipeline.feasibility.motion import motion_of
from pipeline.robot import Robot
from tests.factories.robot_clips import standing

FRAMES = 20


@pytest.mark.parametrize(
    ("seconds", "share", "allowed"),
    [
        (6.0, 0.12, 0.12),
        (2.0, 0.12, 0.12),
        (1.0, 0.12, 0.24),
        (0.4, 0.12, 0.35),
        (0.4, 0.035, 0.175),
        (0.4, 0.2, 0.35),
        (0.4, 0.4, 0.4),
    ],
)
def test_a_short_clip_may_have_as_many_bad_frames_as_two_seconds_but_not_most_of_its_own(
    robot: Robot, limits: FeasibilitySettings, seconds: float, share: float, allowed: float
):
    cut = dataclasses.replace(limits.cut, share_s=2.0, short_share=0.35)
    motion = motion_of(standing(robot, seconds), robot, dataclasses.replace(limits, cut=cut))
    assert motion.largest_share(share) == pytest.approx(allowed)


def _mislabelled(clip: RobotClip, robot: Robot, bad: np.ndarray) -> RobotClip:
    """Both feet stand; labels say that they don't."""
    return dataclasses.replace(clip, contacts=np.repeat(~bad[:, None], 2, axis=1))


def _crossed(clip: RobotClip, robot: Robot, bad: np.ndarray) -> RobotClip:
    joints = clip.joint_pos.copy()
    for side, angle in (("Left", -0.2), ("Right", 0.2)):
        joints[bad, robot.joint(f"{side}_Hip_Roll")] = angle
    return dataclasses.replace(clip, joint_pos=joints)


def _flung(clip: RobotClip, robot: Robot, bad: np.ndarray) -> RobotClip:
    """An arm at 1.2 times its motor's speed, there and back in turn."""
    joint = robot.joint("Left_Shoulder_Pitch")
    step = 1.2 * robot.motor_speed_limit[joint] / clip.fps
    joints, forth = clip.joint_pos.copy(), np.cumsum(np.diff(bad.astype(int), prepend=0) == 1) % 2 * 2 - 1
    joints[:, joint] += np.cumsum(np.where(bad, forth * step, 0.0)) - step
    return dataclasses.replace(clip, joint_pos=joints)


def _verdict(clip: RobotClip, robot: Robot, limits: FeasibilitySettings, code: str) -> Verdict:
    verdicts = assess(motion_of(clip, robot, limits), limits).verdicts
    return next(verdict for verdict in verdicts if verdict.code == code)


@pytest.mark.parametrize(
    ("fault", "code"),
    [
        (_mislabelled, "contact_disagreement"),
        (_crossed, "self_collision_share"),
        (_flung, "joint_speed_over_share"),
    ],
)
def test_a_clip_of_twenty_frames_that_is_at_fault_in_half_of_them_is_refused(
    robot: Robot,
    limits: FeasibilitySettings,
    fault: Callable[[RobotClip, Robot, np.ndarray], RobotClip],
    code: str,
):
    clip, frames = standing(robot, FRAMES / 50.0), np.arange(FRAMES)
    found = _verdict(fault(clip, robot, frames % 10 < 5), robot, limits, code)
    assert found.value == pytest.approx(0.5, abs=0.11), "speed is a difference over three frames"
    assert not found.holds
    few = _verdict(fault(clip, robot, frames == 7), robot, limits, code)
    assert few.holds
