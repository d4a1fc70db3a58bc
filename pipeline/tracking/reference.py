"""States of a 50 Hz reference motion for the tracking task, and the tracker's observation."""

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float, Int

from pipeline import rotation, time_series
from pipeline.tracking.task import CONTROL_HZ


@dataclass(frozen=True, kw_only=True)
class ReferenceStates:
    """t frames of a robot with j joints and l links, in the model's order. Names as in mjlab's motion files; units m,
    rad and s."""

    joint_pos: Float[np.ndarray, "t j"]
    joint_vel: Float[np.ndarray, "t j"]
    body_pos_w: Float[np.ndarray, "t l 3"]
    """Origins of the link frames [m]; the root link is the first."""
    body_quat_w: Float[np.ndarray, "t l 4"]
    """wxyz, sign-continuous."""
    body_lin_vel_w: Float[np.ndarray, "t l 3"]
    body_ang_vel_w: Float[np.ndarray, "t l 3"]

    @property
    def frame_count(self) -> int:
        return len(self.joint_pos)


def reference_states(
    model: mujoco.MjModel,
    root_pos_w: Float[np.ndarray, "t 3"],
    root_quat_w: Float[np.ndarray, "t 4"],
    joint_pos: Float[np.ndarray, "t j"],
) -> ReferenceStates:
    """Forward kinematics of a 50 Hz motion, velocities by central differences.

    `model` is the robot's: a free joint, then its hinges; body 1 + i is link i.
    """
    data = mujoco.MjData(model)
    joints = joint_pos.shape[1]
    # the robot's bodies: the free joint's body and those below it
    links = slice(1, 1 + int(np.count_nonzero(model.body_rootid == model.jnt_bodyid[0])))
    body_pos_w = np.empty((len(joint_pos), links.stop - 1, 3))
    body_quat_w = np.empty((len(joint_pos), links.stop - 1, 4))
    for frame in range(len(joint_pos)):
        data.qpos[:3], data.qpos[3:7] = root_pos_w[frame], root_quat_w[frame]
        data.qpos[7 : 7 + joints] = joint_pos[frame]
        mujoco.mj_kinematics(model, data)
        body_pos_w[frame], body_quat_w[frame] = data.xpos[links], data.xquat[links]
    body_quat_w = rotation.make_continuous(body_quat_w)
    return ReferenceStates(
        joint_pos=np.array(joint_pos),
        joint_vel=time_series.derivative(joint_pos, CONTROL_HZ),
        body_pos_w=body_pos_w,
        body_quat_w=body_quat_w,
        body_lin_vel_w=time_series.derivative(body_pos_w, CONTROL_HZ),
        body_ang_vel_w=rotation.angular_velocity_w(body_quat_w, CONTROL_HZ),
    )


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
    """Observation at a state, term by term as mjlab's tracking task computes it (`task.OBSERVATION`).

    Args:
        qpos: root position [m], root quaternion wxyz, joint positions [rad]
        qvel: root velocity (world) [m/s], root angular velocity (root frame) [rad/s], joint velocities [rad/s]
        link_pos_w: origins of the key links, the root first [m]
        link_mat_w: rotation matrices of the key links, row by row
        reference: the tracked motion
        frame: frame of the reference to reach at the end of the control step
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
    """Rotation matrix of one unit quaternion wxyz; faster than `pipeline.rotation`, which is for batches."""
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
