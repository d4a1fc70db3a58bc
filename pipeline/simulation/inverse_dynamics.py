"""What forces a motion needs: M(q) a + h(q, v), in MuJoCo, with nothing touched."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series
from pipeline.robot import Robot, mujoco_model


@dataclass(frozen=True, kw_only=True)
class MotionForces:
    """Needed forces of T frames, and the lines the joints turn about."""

    root_wrench_w: Float[np.ndarray, "t 6"]
    """Force [N] and moment about the root link's origin [N m] that the surroundings must supply, world frame."""
    joint_torque: Float[np.ndarray, "t j"]
    """Torque [N m] each joint needs where the surroundings push on the root alone."""
    joint_axis_w: Float[np.ndarray, "t j 3"]
    joint_anchor_w: Float[np.ndarray, "t j 3"]


@dataclass(frozen=True, kw_only=True)
class StateSeries:
    """States of T frames in MuJoCo's coordinates: the angular velocity of the root is in its own frame."""

    qpos: Float[np.ndarray, "t q"]
    qvel: Float[np.ndarray, "t v"]
    qacc: Float[np.ndarray, "t v"]


def states(
    root_pos_w: Float[np.ndarray, "t 3"],
    root_quat_w: Float[np.ndarray, "t 4"],
    joint_pos: Float[np.ndarray, "t j"],
    fps: float,
    cutoff_hz: float,
) -> StateSeries:
    """States of a motion: low-passed at `cutoff_hz` (zero-phase), velocities and accelerations by differences.

    Accelerations of positions are second central differences over neighbouring frames, which lose less of
    a fast motion than the derivative of a derivative.
    """
    pos = time_series.smooth(root_pos_w, fps, cutoff_hz)
    quat = time_series.smooth_quat(root_quat_w, fps, cutoff_hz)
    joints = time_series.smooth(joint_pos, fps, cutoff_hz)
    ang_vel_b = rotation.rotate_inverse(quat, rotation.angular_velocity_w(quat, fps))
    qvel = np.concatenate([time_series.derivative(pos, fps), ang_vel_b, time_series.derivative(joints, fps)], axis=1)
    qacc = np.concatenate(
        [_second_difference(pos, fps), _angular_acceleration_b(quat, fps), _second_difference(joints, fps)], axis=1
    )
    return StateSeries(qpos=np.concatenate([pos, quat, joints], axis=1), qvel=qvel, qacc=qacc)


def motion_forces(robot: Robot, series: StateSeries) -> MotionForces:
    """Needed forces of each state (recursive Newton-Euler with armature, without contacts and limits)."""
    model = mujoco_model(robot)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(model)
    count, joints = len(series.qpos), model.nv - 6
    force = np.empty((count, model.nv))
    axes, anchors = np.empty((count, joints + 1, 3)), np.empty((count, joints + 1, 3))
    for frame in range(count):
        data.qpos[:], data.qvel[:], data.qacc[:] = series.qpos[frame], series.qvel[frame], series.qacc[frame]
        mujoco.mj_inverse(model, data)
        force[frame], axes[frame], anchors[frame] = data.qfrc_inverse, data.xaxis, data.xanchor
    moment_w = rotation.rotate(series.qpos[:, 3:7], force[:, 3:6])
    return MotionForces(
        root_wrench_w=np.concatenate([force[:, :3], moment_w], axis=1),
        joint_torque=force[:, 6:],
        joint_axis_w=axes[:, 1:],
        joint_anchor_w=anchors[:, 1:],
    )


def _second_difference(values: np.ndarray, fps: float) -> np.ndarray:
    """Second derivative over time of (t, n); the ends take their neighbours' value, below three frames zero."""
    result = np.zeros_like(values)
    if len(values) > 2:
        result[1:-1] = (values[2:] - 2.0 * values[1:-1] + values[:-2]) * fps**2
        result[0], result[-1] = result[1], result[-2]
    return result


def _angular_acceleration_b(quat: np.ndarray, fps: float) -> np.ndarray:
    """d/dt of the body-frame angular velocity, from the rotations to both neighbours."""
    result = np.zeros((len(quat), 3))
    if len(quat) > 2:
        step = rotation.to_rotvec(rotation.multiply(rotation.conjugate(quat[:-1]), quat[1:]))
        result[1:-1] = (step[1:] - step[:-1]) * fps**2
        result[0], result[-1] = result[1], result[-2]
    return result
