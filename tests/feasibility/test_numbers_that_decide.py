"""Numbers that no motion is held against decide verdicts too: another value of each gives another verdict."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.feasibility import FeasibilitySettings, process
from pipeline.feasibility.foot_criteria import foot_slip, gliding, label_disagreement
from pipeline.feasibility.motion import Motion, motion_of
from pipeline.feasibility.torque_criteria import dynamics
from pipeline.files import settings
from pipeline.quality.sole import SoleMotion
from pipeline.robot import Robot
from tests.factories.robot_clips import standing

LIMITS = settings.read(Path(__file__).resolve().parents[2] / "data" / "feasibility.yaml", FeasibilitySettings)


Value = float | tuple[float, float]


def _with(name: str, value: Value) -> FeasibilitySettings:
    """The file's settings with another value of `section.name` or `section.part.name`."""
    return _replaced(LIMITS, name.split("."), value)


def _replaced(settings: Any, path: list[str], value: Value) -> Any:
    inner = value if len(path) == 1 else _replaced(getattr(settings, path[0]), path[1:], value)
    return dataclasses.replace(settings, **{path[0]: inner})


def _soles_replaced(motion: Motion, height: np.ndarray, velocity: np.ndarray) -> Motion:
    """The motion with soles whose corners are at a height [m] (t, 4) and move at a velocity [m/s] (t, 4, 3)."""
    sole = motion.sole
    pos, vel = sole.corner_pos_w.copy(), np.broadcast_to(velocity[:, None], sole.corner_vel_w.shape).copy()
    pos[..., 2] = height[:, None]
    return dataclasses.replace(motion, sole=SoleMotion(fps=sole.fps, corner_pos_w=pos, corner_vel_w=vel))


def _on_the_left_foot(robot: Robot, lean: float = 0.2) -> RobotClip:
    """It leans to the left over its left foot, whose label alone says contact."""
    clip = standing(robot, 2.0)
    joints = clip.joint_pos.copy()
    joints[:, robot.joint("Left_Ankle_Roll")] += lean
    tilt = rotation.from_axis_angle(np.array([1.0, 0.0, 0.0]), np.full(clip.frame_count, -lean))
    contacts = np.tile(np.array([True, False]), (clip.frame_count, 1))
    return dataclasses.replace(clip, joint_pos=joints, root_quat_w=tilt, contacts=contacts)


def _on_the_ground(motion: Motion, blinking: int = 0) -> Motion:
    """The motion with soles on the ground; every so many frames they are off it in one of them."""
    frames = motion.clip.frame_count
    height = np.zeros((frames, 4))
    if blinking:
        height[::blinking] = 0.05
    return _soles_replaced(motion, height, np.zeros((frames, 4, 3)))


def _consistent(motion: Motion, limits: FeasibilitySettings) -> bool:
    return dynamics(motion, limits.torque).consistent


def _slips_at_the_heel(robot: Robot, limits: FeasibilitySettings) -> bool:
    """Both feet turn about their toes; the heels are 5 mm lower."""
    motion = motion_of(standing(robot), robot, limits)
    corners = motion.sole.corner_pos_w[0, 0]
    front = corners[:, 0] > corners[:, 0].mean()
    height = np.tile(np.where(front, 0.005, 0.0), (motion.clip.frame_count, 1))
    velocity = np.where(front, 0.0, 0.5)[:, None] * np.array([0.0, 1.0, 0.0])
    soles = _soles_replaced(motion, height, np.tile(velocity, (motion.clip.frame_count, 1, 1)))
    return not all(verdict.holds for verdict in foot_slip(soles, limits.feet))


def _slides(speed: float, ground_speed: float) -> Callable[[Robot, FeasibilitySettings], bool]:
    def held(robot: Robot, limits: FeasibilitySettings) -> bool:
        """Without labels, on feet that slide at a speed [m/s], carried over ground [m/s]."""
        clip = standing(robot, 2.0)
        root = clip.root_pos_w + ground_speed * np.arange(clip.frame_count)[:, None] / clip.fps * np.array([1.0, 0, 0])
        motion = motion_of(dataclasses.replace(clip, root_pos_w=root, contacts=None), robot, limits)
        motion = dataclasses.replace(motion, contacts=np.ones((clip.frame_count, 2), dtype=bool))
        velocity = np.tile([speed, 0.0, 0.0], (clip.frame_count, 4, 1))
        soles = _soles_replaced(motion, np.zeros((clip.frame_count, 4)), velocity)
        return all(verdict.holds for verdict in foot_slip(soles, limits.feet))

    return held


def _keeps_what_is_left(robot: Robot, limits: FeasibilitySettings) -> bool:
    """A clip with one frame that is no posture at all."""
    clip = standing(robot, 4.0)
    joints = clip.joint_pos.copy()
    joints[100, robot.joint("Left_Elbow_Yaw")] += 2.0
    outcome = process(dataclasses.replace(clip, joint_pos=joints), {}, settings=limits, robot=robot)
    return bool(outcome.pieces)


def _is_explained_without_a_frame_in_three(robot: Robot, limits: FeasibilitySettings) -> bool:
    """Standing, with no contact labelled in each third frame."""
    clip = standing(robot, 2.0)
    contacts = np.ones((clip.frame_count, 2), dtype=bool)
    contacts[::3] = False
    return _consistent(motion_of(dataclasses.replace(clip, contacts=contacts), robot, limits), limits)


def _is_explained_when_soles_blink(robot: Robot, limits: FeasibilitySettings) -> bool:
    """Standing without labels, the soles off the ground in each third frame."""
    clip = dataclasses.replace(standing(robot, 2.0), contacts=None)
    return _consistent(_on_the_ground(motion_of(clip, robot, limits), blinking=3), limits)


def _is_explained_when_soles_are_off_for_three_frames(robot: Robot, limits: FeasibilitySettings) -> bool:
    """Standing without labels, the soles off the ground in three of six frames."""
    motion = motion_of(dataclasses.replace(standing(robot, 2.0), contacts=None), robot, limits)
    height = np.where(np.arange(motion.clip.frame_count) % 6 < 3, 0.05, 0.0)
    height = np.repeat(height[:, None], 4, axis=1)
    return _consistent(_soles_replaced(motion, height, np.zeros((*height.shape, 3))), limits)


def _holds_with_a_late_label(robot: Robot, limits: FeasibilitySettings) -> bool:
    """Standing on two feet with a hip of 6 N m, the other foot not labelled for six frames."""
    limit = robot.torque_limit.copy()
    limit[robot.joint("Right_Hip_Roll")] = 6.0
    weak = dataclasses.replace(robot, torque_limit=limit)
    clip = standing(weak, 2.0)
    contacts = np.ones((clip.frame_count, 2), dtype=bool)
    contacts[50:56, 0] = False
    found = dynamics(motion_of(dataclasses.replace(clip, contacts=contacts), weak, limits), limits.torque)
    assert found.consistent
    return all(verdict.holds for verdict in found.verdicts)


def _is_explained_with_a_fault(robot: Robot, limits: FeasibilitySettings) -> bool:
    """Standing, with no contact labelled in .1 s of two."""
    clip = standing(robot, 2.0)
    contacts = np.ones((clip.frame_count, 2), dtype=bool)
    contacts[50:56] = False
    return _consistent(motion_of(dataclasses.replace(clip, contacts=contacts), robot, limits), limits)


def _is_explained_where_it_slips(robot: Robot, limits: FeasibilitySettings) -> bool:
    """On ice, pushed to and fro at .15 g: friction lacks .11 of the weight, and nothing is missing about the root."""
    clip = standing(robot, 2.0)
    shaken = clip.root_pos_w.copy()
    shaken[:, 0] += 0.0094 * np.sin(2.0 * np.pi * 2.0 * np.arange(clip.frame_count) / clip.fps)
    ice = dataclasses.replace(limits, torque=dataclasses.replace(limits.torque, friction=0.05))
    return _consistent(_on_the_ground(motion_of(dataclasses.replace(clip, root_pos_w=shaken), robot, ice)), ice)


def _is_explained_where_it_tips(robot: Robot, limits: FeasibilitySettings) -> bool:
    """On one leg, leaning so far that its weight lies 1 cm beside its foot."""
    return _consistent(_on_the_ground(motion_of(_on_the_left_foot(robot, 0.3), robot, limits)), limits)


def _weak_hip_shows(robot: Robot, limits: FeasibilitySettings) -> bool:
    """On one leg with a hip of 2 N m."""
    limit = robot.torque_limit.copy()
    limit[robot.joint("Left_Hip_Roll")] = 2.0
    weak = dataclasses.replace(robot, torque_limit=limit)
    found = dynamics(_on_the_ground(motion_of(_on_the_left_foot(weak), weak, limits)), limits.torque)
    return found.consistent and not all(verdict.holds for verdict in found.verdicts)


def _limits_of_a_reference_are_kept(robot: Robot, limits: FeasibilitySettings) -> bool:
    """Beside its standing foot, with a hip of 10 N m: no forces explain it."""
    limit = robot.torque_limit.copy()
    limit[robot.joint("Left_Hip_Roll")] = 10.0
    weak = dataclasses.replace(robot, torque_limit=limit)
    found = dynamics(_on_the_ground(motion_of(_on_the_left_foot(weak, 0.02), weak, limits)), limits.torque)
    assert not found.consistent
    return next(verdict.holds for verdict in found.verdicts if verdict.code == "torque_over_run_s")


def _soles_bear(height: float, speed: float, ground_speed: float = 0.0) -> Callable[[Robot, FeasibilitySettings], bool]:
    def explained(robot: Robot, limits: FeasibilitySettings) -> bool:
        """Upright without labels on soles at that height [m] and of that speed [m/s], carried over ground [m/s]."""
        clip = standing(robot, 2.0)
        root = clip.root_pos_w + ground_speed * np.arange(clip.frame_count)[:, None] / clip.fps * np.array([1.0, 0, 0])
        motion = motion_of(dataclasses.replace(clip, root_pos_w=root, contacts=None), robot, limits)
        frames = motion.clip.frame_count
        velocity = np.tile([speed, 0.0, 0.0], (frames, 4, 1))
        return _consistent(_soles_replaced(motion, np.full((frames, 4), height), velocity), limits)

    return explained


def _labelled_soles_bear(height: float) -> Callable[[Robot, FeasibilitySettings], bool]:
    def explained(robot: Robot, limits: FeasibilitySettings) -> bool:
        """Upright on soles at that height [m] that are labelled as standing."""
        motion = motion_of(standing(robot, 2.0), robot, limits)
        soles = np.full((motion.clip.frame_count, 4), height)
        return _consistent(_soles_replaced(motion, soles, np.zeros((*soles.shape, 3))), limits)

    return explained


def _labels_agree(speeds: np.ndarray) -> Callable[[Robot, FeasibilitySettings], bool]:
    def agree(robot: Robot, limits: FeasibilitySettings) -> bool:
        """Labelled as standing throughout, with soles of those speeds [m/s]."""
        motion = motion_of(standing(robot, 2.0), robot, limits)
        velocity = speeds[:, None, None] * np.tile([1.0, 0.0, 0.0], (motion.clip.frame_count, 4, 1))
        return label_disagreement(_soles_replaced(motion, np.zeros((len(speeds), 4)), velocity), limits.feet).holds

    return agree


def _glides(seconds: float, ground_speed: float) -> Callable[[Robot, FeasibilitySettings], bool]:
    def held(robot: Robot, limits: FeasibilitySettings) -> bool:
        """Without labels, carried over ground [m/s], and no foot stands for that long [s]."""
        clip = standing(robot, 2.0)
        frames = np.arange(clip.frame_count)
        root = clip.root_pos_w + ground_speed * frames[:, None] / clip.fps * np.array([1.0, 0.0, 0.0])
        motion = motion_of(dataclasses.replace(clip, root_pos_w=root, contacts=None), robot, limits)
        stands = np.abs(frames - 50) > seconds * clip.fps / 2.0
        contacts = np.repeat(stands[:, None], 2, axis=1)
        return all(verdict.holds for verdict in gliding(dataclasses.replace(motion, contacts=contacts), limits.feet))

    return held


SLOW, BLINKING = np.full(100, 0.5), np.where(np.arange(100) % 4 < 2, 0.0, 1.0)
"""Faster than contact begins, not than it ends; and too fast in two of four frames."""
QUICKER = np.where(np.arange(100) < 10, 0.0, 0.5)
"""Slow enough to begin, then only to go on."""


@pytest.mark.parametrize(
    ("name", "value", "case"),
    [
        ("feet.level", 0.001, _slips_at_the_heel),
        ("feet.told_slip_mean", (0.1, 0.04), _slides(0.08, 0.0)),
        ("feet.told_slip_mean", (0.05, 0.0), _slides(0.08, 1.5)),
        ("feet.glide_s", (0.2, 0.075), _glides(0.2, 0.5)),
        ("feet.glide_s", (0.08, 0.0), _glides(0.16, 1.6)),
        ("cut.max_cuts", 0, _keeps_what_is_left),
        ("torque.label_reach_s", 0.0, _is_explained_without_a_frame_in_three),
        ("torque.told_reach_s", (0.0, 0.0), _is_explained_when_soles_blink),
        ("torque.told_reach_s", (0.02, 0.02), _holds_with_a_late_label),
        ("torque.told_reach_s", (0.0, 0.02), _is_explained_when_soles_are_off_for_three_frames),
        ("torque.told_reach_s", (0.04, 0.0), _is_explained_when_soles_are_off_for_three_frames),
        ("torque.touch_height", 0.01, _labelled_soles_bear(0.015)),
        ("torque.touch_height", 0.04, _labelled_soles_bear(0.03)),
        ("torque.told_speed", (0.1, 0.3), _soles_bear(0.0, 0.2)),
        ("torque.told_speed", (0.7, 0.3), _soles_bear(0.0, 0.5)),
        ("torque.told_speed", (0.3, 0.0), _soles_bear(0.0, 0.5, ground_speed=1.5)),
        ("torque.consistent_share", 1.0, _is_explained_with_a_fault),
        ("torque.consistent.force", 0.05, _is_explained_where_it_slips),
        ("torque.consistent.lever", 0.005, _is_explained_where_it_tips),
        ("torque.strict_excess", 3.0, _weak_hip_shows),
        ("torque.reference_excess", 0.003, _limits_of_a_reference_are_kept),
        ("contact.height", 0.002, _soles_bear(0.005, 0.0)),
        ("contact.off_speed", 0.45, _labels_agree(QUICKER)),
        ("contact.on_speed", 0.6, _labels_agree(SLOW)),
        ("contact.shortest_s", 0.1, _labels_agree(BLINKING)),
    ],
)
def test_another_value_gives_another_verdict(
    robot: Robot, name: str, value: Value, case: Callable[[Robot, FeasibilitySettings], bool]
):
    assert case(robot, LIMITS) != case(robot, _with(name, value))


def test_another_stride_gives_another_verdict(robot: Robot, monkeypatch: pytest.MonkeyPatch):
    """A limit that grows with speed grows with that of a stride, in which swaying to and fro cancels: half of one, and
    who sways at .9 m/s may glide for .1 s."""
    clip = standing(robot, 4.0)
    frames = np.arange(clip.frame_count)
    root = clip.root_pos_w + 0.15 * np.sin(2.0 * np.pi * frames / clip.fps)[:, None] * np.array([0.0, 1.0, 0.0])
    glides = np.abs(frames - 97.5) <= 2.5

    def holds() -> bool:
        motion = motion_of(dataclasses.replace(clip, root_pos_w=root, contacts=None), robot, LIMITS)
        told = np.repeat(~glides[:, None], 2, axis=1)
        return all(verdict.holds for verdict in gliding(dataclasses.replace(motion, contacts=told), LIMITS.feet))

    whole = holds()
    monkeypatch.setattr("pipeline.quality.command_velocity.STRIDE_S", 0.5)
    assert (whole, holds()) == (False, True)
