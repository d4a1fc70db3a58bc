"""The mirror map: an involution whose kinematics is the mirror image."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.robot import Kinematics, Robot
from pipeline.robot.legs import mirrored_name

IN_XZ_PLANE = np.array([1.0, -1.0, 1.0])
WRITTEN_M = 5e-5
"""Makers write positions to 0.01 mm; left and right of such a file differ by that much in each link of a chain [m]."""
EXACT = ("t1", "k1")
"""Robots whose left and right are written alike."""
QUAT_IN_XZ_PLANE = np.array([1.0, -1.0, 1.0, -1.0])
"""A rotation by the vector (x, y, z) becomes one by (-x, y, -z)."""


def mirror(robot: Robot, joint_pos: np.ndarray) -> np.ndarray:
    return robot.mirror_sign * joint_pos[..., robot.mirror_index]


def tolerance_m(robot: Robot) -> float:
    """How far mirrored places may differ [m]."""
    return 1e-9 if robot.name in EXACT else WRITTEN_M


def test_mirroring_twice_is_the_identity(robot: Robot):
    pose = np.arange(1.0, 1.0 + len(robot.joint_names))
    assert mirror(robot, mirror(robot, pose)) == pytest.approx(pose, abs=0.0)


def test_links_of_the_mirrored_pose_are_the_mirror_image(robot: Robot, poses):
    root_pos, root_quat, joint_pos = poses
    kinematics = Kinematics(robot)
    links = kinematics.forward(root_pos, root_quat, joint_pos)
    image = kinematics.forward(root_pos * IN_XZ_PLANE, root_quat * QUAT_IN_XZ_PLANE, mirror(robot, joint_pos))
    partner = robot.link_mirror_index
    assert image.pos_w == pytest.approx(links.pos_w[:, partner] * IN_XZ_PLANE, abs=tolerance_m(robot))
    dots = np.abs(np.sum(image.quat_w * links.quat_w[:, partner] * QUAT_IN_XZ_PLANE, axis=-1))
    assert dots == pytest.approx(1.0, abs=1e-9)


def test_left_and_right_sites_are_mirror_images(robot: Robot):
    kinematics = Kinematics(robot)
    poses = kinematics.forward(
        np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]]), np.zeros((1, len(robot.joint_names)))
    )
    human = [(f"left_{point}", f"right_{point}") for point in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")]
    for left, right in (robot.hands, robot.feet, *human):
        pos = kinematics.site_pos_w(poses, (left, right))[0]
        assert pos[0, 1] > 0.05, f"{left} is not on the left"
        assert pos[1] == pytest.approx(pos[0] * IN_XZ_PLANE, abs=tolerance_m(robot))
    corners = [kinematics.site_pos_w(poses, names)[0] for names in robot.sole_corners]
    mirrored = corners[0] * IN_XZ_PLANE
    assert sorted(map(tuple, mirrored.round(9))) == sorted(map(tuple, corners[1].round(9)))


def test_the_default_pose_is_its_own_mirror_image(robot: Robot):
    assert mirror(robot, robot.default_joint_pos) == pytest.approx(robot.default_joint_pos, abs=0.0)


def test_pitch_keeps_its_sign_and_roll_and_yaw_change_it(t1: Robot):
    for name, sign in zip(t1.joint_names, t1.mirror_sign, strict=True):
        # The elbow's names say how the arm moves when it hangs: its "pitch" axis is y, its "yaw" axis z.
        assert sign == (1.0 if "Pitch" in name or name == "Head_pitch" else -1.0), name


def test_every_piece_of_a_name_is_swapped_once():
    pairs = [("Left", "Right"), ("left", "right"), ("AL", "AR")]
    assert mirrored_name("left_sole_front_left", pairs) == "right_sole_front_right"
    assert mirrored_name("Shank_Right", pairs) == "Shank_Left"
    assert mirrored_name("AR3", pairs) == "AL3"
    assert mirrored_name("Waist", pairs) == "Waist"
