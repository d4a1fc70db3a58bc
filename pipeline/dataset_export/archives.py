"""Clips of a database as the archives that other programs load: mjlab and BeyondMimic, and GMR, both without pickle."""

from __future__ import annotations

import io
from collections.abc import Callable

import numpy as np

from pipeline import rotation, time_series
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Kinematics, Robot


def tracking_archive(clip: RobotClip, robot: Robot) -> bytes:
    """The npz that mjlab's and BeyondMimic's motion loaders read.

    `joint_pos`, `joint_vel` (t, j) [rad, rad/s], `body_pos_w`, `body_lin_vel_w`, `body_ang_vel_w` (t, b, 3) [m, m/s,
    rad/s], `body_quat_w` (t, b, 4) wxyz, `fps` (1,), and the names that upstream leaves out: `joint_names`,
    `body_names`. Bodies are all links in the order of the robot's model, joints likewise.
    """
    poses = Kinematics(robot).forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    quat = rotation.make_continuous(poses.quat_w)
    return _npz(
        fps=np.array([clip.fps]),
        joint_pos=clip.joint_pos,
        joint_vel=clip.joint_vel(),
        body_pos_w=poses.pos_w,
        body_quat_w=quat,
        body_lin_vel_w=time_series.derivative(poses.pos_w, clip.fps),
        body_ang_vel_w=rotation.angular_velocity_w(quat, clip.fps),
        joint_names=np.array(clip.joint_names),
        body_names=np.array(robot.link_names),
    )


def gmr_archive(clip: RobotClip, robot: Robot) -> bytes:
    """GMR's arrays in an npz in place of its pickle.

    `fps`, `root_pos` (t, 3) [m], `root_rot` (t, 4) xyzw, `root_rot_order`, `dof_pos` (t, j) [rad], `dof_names`,
    `local_body_pos` (t, b, 3) [m] of the links in the root's frame and `link_body_list`.
    """
    poses = Kinematics(robot).forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    local = rotation.rotate_inverse(clip.root_quat_w[:, None], poses.pos_w - clip.root_pos_w[:, None])
    return _npz(
        fps=np.array(clip.fps),
        root_pos=clip.root_pos_w,
        root_rot=np.roll(clip.root_quat_w, -1, axis=1),
        root_rot_order=np.array("xyzw"),
        dof_pos=clip.joint_pos,
        dof_names=np.array(clip.joint_names),
        local_body_pos=local,
        link_body_list=np.array(robot.link_names),
    )


ARCHIVES: dict[str, Callable[[RobotClip, Robot], bytes]] = {"mjlab": tracking_archive, "gmr": gmr_archive}
"""Format -> the bytes of a clip's archive."""


def _npz(**arrays: np.ndarray) -> bytes:
    """Numbers as float32 (the loaders' own), text as it is; the same bytes for the same clip."""
    stream = io.BytesIO()
    plain = {name: each.astype("f4") if each.dtype.kind == "f" else each for name, each in arrays.items()}
    np.savez(stream, allow_pickle=False, **plain)
    return stream.getvalue()
