"""The tracker's observation in numpy, term by term as mjlab's tracking task computes it (`task.OBSERVATION`)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pipeline.tracking.reference import ReferenceStates


def observe(
    qpos: Float[np.ndarray, " q"],
    qvel: Float[np.ndarray, " v"],
    link_pos_w: Float[np.ndarray, "k 3"],
    link_mat_w: Float[np.ndarray, "k 9"],
    reference: ReferenceStates,
    frame: int,
    default_joint_pos: Float[np.ndarray, " j"],
    last_action: Float[np.ndarray, " a"],
) -> Float[np.ndarray, " n"]:
    """Observation at a state, with the reference frame to reach at the end of the control step.

    Args:
        qpos: root position [m], root quaternion wxyz, joint positions [rad]
        qvel: root velocity (world) [m/s], root angular velocity (root frame) [rad/s], joint velocities [rad/s]
        link_pos_w: origins of the key links, the root first [m]
        link_mat_w: rotation matrices of the key links, row by row
        reference: the motion that is tracked
        frame: its frame
        default_joint_pos: the robot's default pose [rad]
        last_action: the network's last output
    """
    joints = len(default_joint_pos)
    link_rot_w = link_mat_w.reshape(-1, 3, 3)
    root_rot_w, root_pos_w = link_rot_w[0], link_pos_w[0]
    anchor_rot_b = root_rot_w.T @ rotation_matrix(reference.body_quat_w[frame, 0])
    link_rot_b = root_rot_w.T @ link_rot_w
    return np.concatenate(
        [
            reference.joint_pos[frame],
            reference.joint_vel[frame],
            (reference.body_pos_w[frame, 0] - root_pos_w) @ root_rot_w,
            anchor_rot_b[:, :2].ravel(),
            ((link_pos_w - root_pos_w) @ root_rot_w).ravel(),
            link_rot_b[:, :, :2].ravel(),
            qvel[:3] @ root_rot_w,
            qvel[3:6],
            qpos[7 : 7 + joints] - default_joint_pos,
            qvel[6 : 6 + joints],
            last_action,
        ]
    )


def rotation_matrix(quat: Float[np.ndarray, " 4"]) -> Float[np.ndarray, "3 3"]:
    """Rotation matrix of one unit quaternion wxyz; `pipeline.rotation` is for many and slower for one."""
    w, x, y, z = quat
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def key_link_index(link_names: tuple[str, ...], key_links: tuple[str, ...]) -> Int[np.ndarray, " k"]:
    """Index of each key link among the links."""
    return np.array([link_names.index(name) for name in key_links])
