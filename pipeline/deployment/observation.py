"""The policy's observation: the last ten frames of 9 + 3 A numbers, oldest first."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from pipeline.deployment.task import DeploymentTask


def frame(
    task: DeploymentTask,
    *,
    gyro_b: Float[np.ndarray, " 3"],
    gravity_b: Float[np.ndarray, " 3"],
    command: Float[np.ndarray, " 3"],
    joint_pos: Float[np.ndarray, " j"],
    joint_vel: Float[np.ndarray, " j"],
    last_action: Float[np.ndarray, " a"],
) -> Float[np.ndarray, " f"]:
    """One frame: gyro, gravity, command, q - q0, dq, last action; joints in the policy's order.

    Args:
        task: joints and default pose
        gyro_b: angular velocity of the root in its frame [rad/s]
        gravity_b: direction of gravity in the root's frame, unit
        command: forward and lateral velocity [m/s], yaw rate [rad/s]
        joint_pos: positions of the robot's joints, in its order [rad]
        joint_vel: their velocities [rad/s]
        last_action: of the control step before, in the policy's order; zeros at the start
    """
    index = task.policy_index
    away = joint_pos[index] - task.default_joint_pos[index]
    return np.concatenate([gyro_b, gravity_b, command, away, joint_vel[index], last_action])


class History:
    """The last frames, time-major, oldest first; zeros before the first ones."""

    def __init__(self, task: DeploymentTask):
        self._frames = np.zeros((task.history, task.frame_size))

    def copy(self) -> History:
        """A copy of the history."""
        twin = object.__new__(History)
        twin._frames = self._frames
        return twin

    def reset(self) -> None:
        self._frames = np.zeros_like(self._frames)

    def push(self, frame: Float[np.ndarray, " f"]) -> Float[np.ndarray, " n"]:
        """Append `frame` and return the observation."""
        self._frames = np.concatenate([self._frames[1:], frame[None]])
        return self._frames.ravel()
