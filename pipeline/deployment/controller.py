"""The policy controller: sensor readings in, joint targets out, one control step at a time."""

import copy
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline.deployment.policy import Policy
from pipeline.deployment.task import DeploymentTask
from pipeline.errors import PipelineError


@dataclass(frozen=True, kw_only=True)
class Reading:
    """Sensor input of a controller; joints in the robot's order."""

    gyro_b: Float[np.ndarray, " 3"]
    """Angular velocity of the root in its frame [rad/s]."""
    gravity_b: Float[np.ndarray, " 3"]
    """Unit gravity vector in the root's frame."""
    joint_pos: Float[np.ndarray, " j"]
    """[rad]"""
    joint_vel: Float[np.ndarray, " j"]
    """[rad/s]"""


def frame(
    task: DeploymentTask, reading: Reading, command: Float[np.ndarray, " 3"], last_action: Float[np.ndarray, " a"]
) -> Float[np.ndarray, " f"]:
    """Build a frame: gyro, gravity, command, q - q0, dq, last action; joints in the policy's order.

    Args:
        task: joints and default pose
        reading: sensor readings
        command: forward and lateral velocity [m/s], yaw rate [rad/s]
        last_action: action of the previous control step, in the policy's order; zeros at the start
    """
    index = task.policy_index
    joint_offset = reading.joint_pos[index] - task.default_joint_pos[index]
    return np.concatenate(
        [reading.gyro_b, reading.gravity_b, command, joint_offset, reading.joint_vel[index], last_action]
    )


class History:
    """The last frames, time-major, oldest first; zeros before the first frame."""

    def __init__(self, task: DeploymentTask):
        self._frames = np.zeros((task.history, task.frame_size))

    def reset(self) -> None:
        self._frames = np.zeros_like(self._frames)

    def push(self, frame: Float[np.ndarray, " f"]) -> Float[np.ndarray, " n"]:
        """Append `frame` and return the observation."""
        self._frames = np.concatenate([self._frames[1:], frame[None]])
        return self._frames.ravel()


class PolicyMisfitError(PipelineError):
    """A policy whose sizes differ from those of the task."""

    def __init__(self, task: DeploymentTask, policy: Policy):
        got = f"{policy.observation_size} observations and {policy.action_size} actions"
        expected = f"{task.observation_size} and {len(task.policy_joints)}"
        detail = f"{task.history} frames of {task.frame_size}"
        super().__init__(f"the policy has {got}; robot '{task.robot}' takes {expected} ({detail}).")


class PolicyController:
    """Controller of one rollout, with history and last action; call it at `control_hz`. Raises PolicyMisfitError."""

    def __init__(self, task: DeploymentTask, policy: Policy):
        if (policy.observation_size, policy.action_size) != (task.observation_size, len(task.policy_joints)):
            raise PolicyMisfitError(task, policy)
        self.task = task
        self.policy = policy
        self._history = History(task)
        self.reset()

    def reset(self) -> None:
        """Reset history and last action to zeros."""
        self._history.reset()
        self.last_action: Float[np.ndarray, " a"] = np.zeros(len(self.task.policy_joints))
        self.observation: Float[np.ndarray, " n"] = np.zeros(self.task.observation_size)
        """The latest observation."""

    def fork(self) -> "PolicyController":
        """A copy in the same state."""
        twin = copy.copy(self)  # state arrays are never modified in place
        twin._history = copy.copy(self._history)
        return twin

    def targets(self, reading: Reading, command: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " j"]:
        """Position targets [rad] of all joints in the robot's order; see `frame` for the arguments."""
        self.observation = self._history.push(frame(self.task, reading, command, self.last_action))
        self.last_action = self.policy.act(self.observation)
        targets = self.task.default_joint_pos.copy()
        targets[self.task.policy_index] += self.task.action_scale * self.last_action
        return targets
