"""Numbers that no motion is held against decide verdicts too: another value of each gives another verdict."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.clips.robot_clip import RobotClip, SimulatedForces
from pipeline.feasibility import FeasibilitySettings, process
from pipeline.feasibility.foot_criteria import foot_slip, gliding, label_disagreement
from pipeline.feasibility.motion import Motion, motion_of
from pipeline.feasibility.torque_criteria import recorded_forces
from pipeline.files import settings
from pipeline.physics import GRAVITY
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


def _with_forces(robot: Robot, joint_torque: np.ndarray, weightless_s: float = 0.0) -> RobotClip:
    """Standing for 2 s; for so long [s] the ground gives no force."""
    clip = standing(robot, 2.0)
    wrench = np.zeros((clip.frame_count, 2, 6))
    wrench[..., 2] = robot.total_mass * GRAVITY / 2.0
    wrench[50 : 50 + round(weightless_s * clip.fps)] = 0.0
    nothing = np.zeros((clip.frame_count, 3))
    forces = SimulatedForces(joint_torque=joint_torque, foot_wrench_w=wrench, other_force_w=nothing, push_w=nothing)
    return dataclasses.replace(clip, forces=forces)


def _is_saturated_at(ratio: float) -> Callable[[Robot, FeasibilitySettings], bool]:
    def held(robot: Robot, limits: FeasibilitySettings) -> bool:
        """All motors at that part of their torque limits throughout."""
        clip = _with_forces(robot, np.tile(ratio * robot.torque_limit, (100, 1)))
        return all(verdict.holds for verdict in recorded_forces(motion_of(clip, robot, limits), limits.torque))

    return held


def _forces_are_missing_for(seconds: float) -> Callable[[Robot, FeasibilitySettings], bool]:
    def held(robot: Robot, limits: FeasibilitySettings) -> bool:
        """Standing on a ground that gives no force for that long [s]; .3 of the weight may be missing."""
        clip = _with_forces(robot, np.zeros((100, len(robot.joint_names))), seconds)
        loose = dataclasses.replace(limits.torque, force_residual=0.3)
        return all(verdict.holds for verdict in recorded_forces(motion_of(clip, robot, limits), loose))

    return held


def _labels_agree(speeds: np.ndarray, height: float = 0.0) -> Callable[[Robot, FeasibilitySettings], bool]:
    def agree(robot: Robot, limits: FeasibilitySettings) -> bool:
        """Labelled as standing throughout, with soles of those speeds [m/s] at that height [m]."""
        motion = motion_of(standing(robot, 2.0), robot, limits)
        velocity = speeds[:, None, None] * np.tile([1.0, 0.0, 0.0], (motion.clip.frame_count, 4, 1))
        soles = _soles_replaced(motion, np.full((len(speeds), 4), height), velocity)
        return all(verdict.holds for verdict in label_disagreement(soles, limits.feet))

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
        ("feet.inferred_slip_mean", (0.1, 0.04), _slides(0.08, 0.0)),
        ("feet.inferred_slip_mean", (0.05, 0.0), _slides(0.08, 1.5)),
        ("feet.glide_s", (0.2, 0.075), _glides(0.2, 0.5)),
        ("feet.glide_s", (0.08, 0.0), _glides(0.16, 1.6)),
        ("cut.max_cuts", 0, _keeps_what_is_left),
        ("torque.saturation", 0.9, _is_saturated_at(0.95)),
        ("torque.residual_window_s", 0.1, _forces_are_missing_for(0.08)),
        ("contact.height", 0.002, _labels_agree(np.zeros(100), 0.005)),
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
    monkeypatch.setattr("pipeline.quality.planar_motion.STRIDE_S", 0.5)
    assert (whole, holds()) == (False, True)
