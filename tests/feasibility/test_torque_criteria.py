"""Torque over the limit: what a motor at its limit looks like at 50 Hz, and that a need is never hidden at the root."""

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.feasibility import FeasibilitySettings
from pipeline.feasibility.motion import Motion, motion_of
from pipeline.feasibility.torque_criteria import Dynamics, dynamics, torque_over_limit
from pipeline.files import settings
from pipeline.quality.sole import SoleMotion, sole_motion
from pipeline.robot import Robot, mujoco_model
from tests.factories.robot_clips import standing

LEAN = 0.2
"""To the left [rad]: the mass is over the left foot."""


@pytest.fixture(scope="module")
def limits(root: Path) -> FeasibilitySettings:
    return settings.read(root / "data" / "feasibility.yaml", FeasibilitySettings)


def _verdicts(robot: Robot, limits: FeasibilitySettings, ratio: np.ndarray):
    """What is said of a knee's torque over its limit (t,)."""
    motion = motion_of(standing(robot, len(ratio) / 50.0), robot, limits)
    torque = np.zeros((len(ratio), len(robot.joint_names)))
    knee = robot.joint("Left_Knee_Pitch")
    torque[:, knee] = ratio * robot.torque_limit[knee]
    return torque_over_limit(motion, torque, limits.torque)


def test_a_motor_at_its_limit_is_not_over_it_for_the_scatter_of_single_frames(robot, limits):
    scatter = np.where(np.arange(300) % 2, 0.15, -0.15)
    _, share, run = _verdicts(robot, limits, 1.0 + scatter)
    assert share.value == 0.0
    assert run.value == 0.0


def test_a_need_of_a_fifth_more_than_the_limit_for_a_fifth_of_a_second_is_told_once_in_six_seconds(robot, limits):
    ratio = np.full(300, 0.5)
    ratio[100:110] = 1.2
    most, share, run = _verdicts(robot, limits, ratio)
    assert most.holds
    assert run.value == pytest.approx(0.16)  # a frame less at each end
    assert not run.holds
    assert share.value == pytest.approx(8 / 300)
    assert run.bad is not None
    assert np.flatnonzero(run.bad).tolist() == list(range(101, 109))


def test_a_need_of_many_times_the_limit_is_told_however_short(robot, limits):
    ratio = np.full(300, 0.5)
    ratio[100:102], ratio[200:202] = 20.0, -20.0
    most, share, run = _verdicts(robot, limits, ratio)
    assert share.holds, "eight of 300 frames"
    assert run.holds, "four frames in a row"
    assert most.value == pytest.approx((20.0 + 20.0 + 0.5) / 3)
    assert not most.holds
    assert most.bad is not None
    assert np.flatnonzero(most.bad).tolist() == [99, 100, 101, 102, 199, 200, 201, 202]
    assert "Left_Knee_Pitch needs 13.50 times its torque limit" in most.text


def test_torques_of_both_signs_in_turn_do_not_add_up(robot, limits):
    _, share, run = _verdicts(robot, limits, np.where(np.arange(300) % 2, 2.0, -2.0))
    assert share.value == 0.0
    assert run.value == 0.0


def _on_one_leg(robot: Robot) -> RobotClip:
    """Leaning to the left as a board, over the left foot, which stays flat; the right one is off the ground."""
    clip = standing(robot, 2.0)
    joints = clip.joint_pos.copy()
    joints[:, robot.joint("Left_Ankle_Roll")] += LEAN
    tilt = rotation.from_axis_angle(np.array([1.0, 0.0, 0.0]), np.full(clip.frame_count, -LEAN))
    leaning = dataclasses.replace(
        clip,
        joint_pos=joints,
        root_quat_w=tilt,
        contacts=np.tile(np.array([True, False]), (clip.frame_count, 1)),
    )
    height = sole_motion(leaning, robot).height
    assert np.all(height[:, 1] - height[:, 0] > 0.02)
    return dataclasses.replace(leaning, root_pos_w=leaning.root_pos_w - np.array([0.0, 0.0, height[0, 0]]))


def _weak(robot: Robot, joint: str, limit: float) -> Robot:
    limits = robot.torque_limit.copy()
    limits[robot.joint(joint)] = limit
    return dataclasses.replace(robot, torque_limit=limits)


def _share(found: Dynamics) -> float:
    return next(verdict.value for verdict in found.verdicts if verdict.code == "torque_over_share")


@pytest.mark.parametrize("part", [0.8, 0.2, 0.1])
def test_a_need_shows_as_torque_however_large_it_is(robot: Robot, limits: FeasibilitySettings, part: float):
    clip = _on_one_leg(robot)
    strong = dynamics(motion_of(clip, robot, limits), limits.torque)
    assert strong.consistent
    assert _share(strong) == 0.0
    need = _hip_need(robot)
    found = dynamics(motion_of(clip, _weak(robot, "Left_Hip_Roll", part * need), limits), limits.torque)
    assert found.consistent, "what no motor can give is no reason to doubt that forces explain the motion"
    assert _share(found) == pytest.approx(1.0)
    residual = next(verdict.value for verdict in found.verdicts if verdict.code == "force_residual")
    assert residual < 0.01


def _hip_need(robot: Robot) -> float:
    """Moment of what hangs on the left hip about its axis [N m]: all of the robot's weight but the left leg's, at the
    horizontal distance of its mass from the hip."""
    clip = _on_one_leg(robot)
    model = mujoco_model(robot)
    data = mujoco.MjData(model)
    data.qpos[:] = np.concatenate([clip.root_pos_w[0], clip.root_quat_w[0], clip.joint_pos[0]])
    mujoco.mj_forward(model, data)
    joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, "Left_Hip_Roll")
    below = {int(model.jnt_bodyid[joint])}
    for body in range(model.nbody):
        if int(model.body_parentid[body]) in below:
            below.add(body)
    others = [body for body in range(1, model.nbody) if body not in below]
    arms = data.xipos[others] - data.xanchor[joint]
    weights = model.body_mass[others, None] * np.array([0.0, 0.0, -9.81])
    return abs(float(np.sum(np.cross(arms, weights) @ data.xaxis[joint])))


def _swinging(motion: Motion, height: float, speed: float) -> Motion:
    """The right foot passes at a height [m] and speed [m/s]; the rest of the robot is as it was."""
    sole = motion.sole
    pos, vel = sole.corner_pos_w.copy(), sole.corner_vel_w.copy()
    pos[:, 1, :, 2], vel[:, 1] = height, np.array([speed, 0.0, 0.0])
    return dataclasses.replace(motion, sole=SoleMotion(fps=sole.fps, corner_pos_w=pos, corner_vel_w=vel))


@pytest.mark.parametrize(("height", "speed"), [(0.005, 1.0), (0.0, 0.4), (0.015, 0.0)])
def test_without_labels_a_foot_that_passes_low_is_not_leant_on(
    robot: Robot, limits: FeasibilitySettings, height: float, speed: float
):
    weak = _weak(robot, "Left_Hip_Roll", _hip_need(robot) / 1.3)
    clip = dataclasses.replace(_on_one_leg(robot), contacts=None)
    found = dynamics(_swinging(motion_of(clip, weak, limits), height, speed), limits.torque)
    assert found.consistent
    assert _share(found) == pytest.approx(1.0)


@pytest.mark.parametrize("labelled", [False, True])
def test_a_foot_may_bear_two_frames_before_it_comes_down_and_one_after_it_left(
    robot: Robot, limits: FeasibilitySettings, labelled: bool
):
    """A low pass begins an impact before it comes; a foot that leaves lets go gently."""
    clip = standing(robot, 2.0)
    contacts = np.ones((clip.frame_count, 2), dtype=bool)
    contacts[:, 1] = (np.arange(clip.frame_count) >= 50) & (np.arange(clip.frame_count) < 60)
    motion = motion_of(dataclasses.replace(clip, contacts=contacts if labelled else None), robot, limits)
    if not labelled:
        pos = motion.sole.corner_pos_w.copy()
        pos[~contacts, :, 2] = 0.05
        motion = dataclasses.replace(motion, sole=dataclasses.replace(motion.sole, corner_pos_w=pos))
    judged = dynamics(motion, dataclasses.replace(limits.torque, consistent_share=0.0)).judged
    bears = np.linalg.norm(judged.force_w[:, 4:], axis=2).sum(axis=1) > 1.0
    assert np.flatnonzero(bears).tolist() == list(range(48, 61))


def test_without_labels_a_foot_that_rests_on_the_ground_helps(robot: Robot, limits: FeasibilitySettings):
    weak = _weak(robot, "Left_Hip_Roll", _hip_need(robot) / 1.3)
    clip = dataclasses.replace(_on_one_leg(robot), contacts=None)
    found = dynamics(_swinging(motion_of(clip, weak, limits), 0.0, 0.0), limits.torque)
    assert _share(found) == 0.0


def test_how_fast_soles_may_be_without_labels_goes_by_the_speed_of_that_time_and_not_of_the_clip(robot, limits):
    clip = dataclasses.replace(standing(robot, 10.0), contacts=None)
    speed = np.interp(np.arange(clip.frame_count) / clip.fps, [4.0, 6.0], [0.0, 1.5])
    root = clip.root_pos_w + (np.cumsum(speed) / clip.fps)[:, None] * np.array([1.0, 0.0, 0.0])
    motion = motion_of(dataclasses.replace(clip, root_pos_w=root), robot, limits)
    pos, vel = motion.sole.corner_pos_w, 0.4 * motion.sole.corner_vel_w
    a, b = limits.torque.told_speed
    assert a + b * motion.ground_speed < 0.4 * 1.5 < a + b * 1.5
    slides = dataclasses.replace(motion, sole=SoleMotion(fps=clip.fps, corner_pos_w=pos, corner_vel_w=vel))
    assert dynamics(slides, limits.torque).consistent
