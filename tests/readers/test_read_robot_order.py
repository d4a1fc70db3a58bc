"""The order of a robot file's quaternion and joints: inferred by kinematics, or refused as ambiguous."""

import numpy as np
import pytest

from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers import Statement, read_motion
from pipeline.robot import Kinematics
from tests.factories.robot_files import ROBOT, assert_truth, npz, truth, write_csv


def walking(heading, frames=120, speed=0.8):
    """A robot that steps in place of its own accord while its root travels ahead: the lower foot stands still."""
    kinematics, time = Kinematics(ROBOT), np.arange(frames) / 50.0
    joints = np.tile(ROBOT.default_joint_pos, (frames, 1))
    swing = 0.4 * np.sin(2 * np.pi * 0.9 * time)
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        joints[:, ROBOT.joint(f"{side}_Hip_Pitch")] += sign * swing
        lift = np.clip(-sign * np.cos(2 * np.pi * 0.9 * time), 0.0, None)
        joints[:, ROBOT.joint(f"{side}_Knee_Pitch")] += 0.5 * lift
        joints[:, ROBOT.joint(f"{side}_Ankle_Pitch")] -= sign * swing + 0.5 * lift
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (frames, 1))
    poses = kinematics.forward(np.zeros((frames, 3)), upright, joints)
    soles = kinematics.site_pos_w(poses, ROBOT.feet)
    root = np.zeros((frames, 3))
    root[:, 2] = -soles[..., 2].min(axis=1)
    for frame in range(1, frames):
        lower = int(soles[frame, :, 2].argmin())
        root[frame, :2] = root[frame - 1, :2] - (soles[frame, lower, :2] - soles[frame - 1, lower, :2])
    turn = np.array([np.cos(heading / 2), 0.0, 0.0, np.sin(heading / 2)])
    rotate = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    root[:, :2] = root[:, :2] @ rotate.T
    return root, np.tile(turn, (frames, 1)), joints


BREADTH_FIRST = [
    *("AAHead_yaw", "Left_Shoulder_Pitch", "Right_Shoulder_Pitch", "Waist", "Head_pitch", "Left_Shoulder_Roll"),
    *("Right_Shoulder_Roll", "Left_Hip_Pitch", "Right_Hip_Pitch", "Left_Elbow_Pitch", "Right_Elbow_Pitch"),
    *("Left_Hip_Roll", "Right_Hip_Roll", "Left_Elbow_Yaw", "Right_Elbow_Yaw", "Left_Hip_Yaw", "Right_Hip_Yaw"),
    *("Left_Knee_Pitch", "Right_Knee_Pitch", "Left_Ankle_Pitch", "Right_Ankle_Pitch", "Left_Ankle_Roll"),
    "Right_Ankle_Roll",
]
"""As Isaac Lab wrote an archive of the T1."""


@pytest.mark.parametrize("heading_deg", range(-180, 181, 30))
@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
def test_the_order_of_a_quaternion_is_inferred_at_every_heading(tmp_path, order, heading_deg):
    root, quat, joints = walking(np.deg2rad(heading_deg))
    columns = quat[:, ["wxyz".index(letter) for letter in order]]
    path = write_csv(tmp_path / "clip.csv", np.concatenate([root, columns, joints], axis=1), comment="# fps: 50")
    read = read_motion(path, "clip")
    np.testing.assert_allclose(np.abs(np.sum(read.clip.root_quat_w * quat, axis=1)), 1.0, atol=1e-9)
    assert [note.code for note in read.notes] == ([] if order == "xyzw" else ["quaternion_order"])


@pytest.mark.parametrize("heading_deg", range(-180, 181, 60))
@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
@pytest.mark.parametrize("archive", ["qpos", "joint_pos"])
def test_the_order_in_an_archive_without_bodies_is_inferred_too(tmp_path, archive, order, heading_deg):
    root, quat, joints = walking(np.deg2rad(heading_deg))
    columns = quat[:, ["wxyz".index(letter) for letter in order]]
    rows = np.concatenate([root, columns, joints], axis=1)
    names = np.array(ROBOT.joint_names)
    np.savez(tmp_path / "clip.npz", **{archive: rows}, frequency=np.array(50.0), fps=np.array(50.0), joint_names=names)
    read = read_motion(tmp_path / "clip.npz", "clip")
    np.testing.assert_allclose(np.abs(np.sum(read.clip.root_quat_w * quat, axis=1)), 1.0, atol=1e-9)
    assert [note.code for note in read.notes] == ([] if order == "wxyz" else ["quaternion_order"])


def test_a_robot_that_stands_is_the_same_motion_under_both_orders_and_needs_no_statement(tmp_path):
    rows = np.tile(np.concatenate([[0, 0, 0.66], [0, 0, 0, 1.0], ROBOT.default_joint_pos]), (20, 1))
    path = write_csv(tmp_path / "clip.csv", rows, comment="# fps: 50")
    np.testing.assert_array_equal(read_motion(path, "clip").clip.root_quat_w[0], [1.0, 0, 0, 0])
    stated = read_motion(path, "clip", Statement(quaternion="wxyz")).clip
    np.testing.assert_array_equal(np.abs(stated.root_quat_w[0]), [0, 0, 0, 1.0])
    with pytest.raises(FileError, match="the stated order of the quaternion is 'zyx', expected wxyz or xyzw"):
        read_motion(path, "clip", Statement(quaternion="zyx"))


def test_soles_that_slide_with_both_orders_make_the_file_ambiguous(tmp_path):
    root, quat, joints = walking(0.0)
    root[:, 1] += 1.5 * np.arange(len(root)) / 50.0
    rows = np.concatenate([root, np.roll(quat, -1, axis=1), joints], axis=1)
    path = write_csv(tmp_path / "clip.csv", rows, comment="# fps: 50")
    with pytest.raises(
        AmbiguousFileError, match=r"order of the root's quaternion can't be inferred.*State `quaternion:"
    ):
        read_motion(path, "clip")
    assert read_motion(path, "clip", Statement(quaternion="xyzw")).clip.frame_count == len(root)


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
def test_breadth_first_joints_without_names_are_inferred_from_the_bodies(tmp_path, order):
    joints = truth()[2][:, [ROBOT.joint(name) for name in BREADTH_FIRST]]
    quat = Kinematics(ROBOT).forward(*truth()).quat_w[..., ["wxyz".index(letter) for letter in order]]
    path = npz(tmp_path / "clip.npz", joint_names=None, body_names=None, joint_pos=joints, body_quat_w=quat)
    read = read_motion(path, "clip")
    assert_truth(read.clip)
    expected = ["joint_order"] if order == "wxyz" else ["joint_order", "quaternion_order"]
    assert [(note.code, note.effect) for note in read.notes] == [(code, "noted") for code in expected]
