"""A reference motion as the tracking task reads it: joints and all links, with velocities, at 50 Hz."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series
from pipeline.tracking.task import CONTROL_HZ


@dataclass(frozen=True, kw_only=True)
class ReferenceStates:
    """T frames of a robot with J joints and L links, in the model's order. Names are those of mjlab's motion files."""

    joint_pos: Float[np.ndarray, "t j"]
    """[rad]"""
    joint_vel: Float[np.ndarray, "t j"]
    """[rad/s]"""
    body_pos_w: Float[np.ndarray, "t l 3"]
    """Origins of the link frames [m]; the root link is the first."""
    body_quat_w: Float[np.ndarray, "t l 4"]
    """wxyz, sign-continuous."""
    body_lin_vel_w: Float[np.ndarray, "t l 3"]
    """[m/s]"""
    body_ang_vel_w: Float[np.ndarray, "t l 3"]
    """[rad/s]"""

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
    # the robot's bodies: those below the free joint's body, itself included
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
