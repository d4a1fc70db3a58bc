"""Trajectories that are a robot's already: jumps and missing frames are cut, small excesses clamped."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.repair import process


@pytest.fixture
def clip(robot) -> RobotClip:
    """Two seconds of walking ahead at .5 m/s along a direction of 40 deg, arms and legs swinging a little."""
    time_s = np.arange(200) / 100.0
    yaw = np.deg2rad(40.0)
    joint_pos = robot.default_joint_pos + 0.1 * np.sin(2 * np.pi * time_s)[:, None]
    joint_pos = np.clip(joint_pos, robot.joint_lower + 0.01, robot.joint_upper - 0.01)
    ahead = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    return RobotClip(
        name="robot/clip",
        fps=100.0,
        robot="t1",
        joint_names=robot.joint_names,
        root_pos_w=np.array([1.0, 2.0, 0.66]) + 0.5 * time_s[:, None] * ahead,
        root_quat_w=np.repeat(rotation.about_z(yaw)[None], 200, axis=0),
        joint_pos=joint_pos,
    )


def test_sound_trajectory_is_only_placed(clip, settings, robot):
    outcome = process(clip, {}, settings=settings, robot=robot)
    piece = outcome.pieces[0]
    assert not outcome.reasons
    np.testing.assert_array_equal(piece.clip.joint_pos, clip.joint_pos)
    np.testing.assert_allclose(piece.clip.root_pos_w[-1], [0.5 * 1.99, 0.0, 0.66], atol=1e-9)
    np.testing.assert_allclose(piece.clip.root_quat_w, np.tile(rotation.IDENTITY, (200, 1)), atol=1e-12)
    assert piece.numbers["heading_rad"] == pytest.approx(np.deg2rad(40.0))


def test_opening_transient_is_cut(clip, settings, robot):
    joint_pos = clip.joint_pos.copy()
    joint_pos[:10, 12] += np.linspace(-6.0, 0.0, 10)
    outcome = process(dataclasses.replace(clip, joint_pos=joint_pos), {}, settings=settings, robot=robot)
    assert outcome.pieces[0].numbers["start_frame"] == 10
    reason = outcome.reasons[0]
    assert (reason.code, reason.effect, reason.start_s) == ("joint_jump", "rejected", 0.0)
    assert clip.joint_names[12] in reason.text


def test_missing_frames_divide_the_clip(clip, settings):
    joint_pos = clip.joint_pos.copy()
    joint_pos[100, 3] = np.nan
    outcome = process(dataclasses.replace(clip, joint_pos=joint_pos), {}, settings=settings)
    assert [(piece.clip.name, piece.clip.frame_count) for piece in outcome.pieces] == [
        ("robot/clip+1", 100),
        ("robot/clip+2", 99),
    ]


def test_root_quaternion_that_is_no_rotation_is_cut(clip, settings):
    quat = clip.root_quat_w.copy()
    quat[150:] *= 1.3
    outcome = process(dataclasses.replace(clip, root_quat_w=quat), {}, settings=settings)
    assert outcome.pieces[0].clip.frame_count == 150
    assert outcome.reasons[0].code == "no_rotation"


def test_small_excess_is_clamped_and_a_large_one_left_to_feasibility(clip, settings, robot):
    joint_pos = clip.joint_pos.copy()
    knee, elbow = robot.joint("Left_Knee_Pitch"), robot.joint("Left_Elbow_Yaw")
    joint_pos[:, knee] = robot.joint_upper[knee] + 0.03
    joint_pos[:, elbow] = robot.joint_lower[elbow] - 0.2
    outcome = process(dataclasses.replace(clip, joint_pos=joint_pos), {}, settings=settings, robot=robot)
    made = outcome.pieces[0].clip.joint_pos
    assert (made[:, knee] == robot.joint_upper[knee]).all()
    assert (made[:, elbow] == joint_pos[:, elbow]).all()
    assert [(reason.code, reason.effect) for reason in outcome.reasons] == [("joint_limit", "repaired")]
    assert outcome.reasons[0].value == pytest.approx(0.03)


def test_joints_of_another_robot_are_an_error(clip, settings, robot):
    other = dataclasses.replace(clip, joint_names=clip.joint_names[::-1])
    with pytest.raises(ClipError, match="the robot 't1' has others"):
        process(other, {}, settings=settings, robot=robot)
