"""The policy controller: sensor readings in, joint targets out, one control step at a time."""

import numpy as np
from jaxtyping import Float

from pipeline.deployment.policy import Policy
from pipeline.deployment.task import DeploymentTask
from pipeline.errors import PipelineError


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
        last_action: action of the previous control step, in the policy's order; zeros at the start
    """
    index = task.policy_index
    away = joint_pos[index] - task.default_joint_pos[index]
    return np.concatenate([gyro_b, gravity_b, command, away, joint_vel[index], last_action])


class History:
    """The last frames, time-major, oldest first; zeros before the first ones."""

    def __init__(self, task: DeploymentTask):
        self._frames = np.zeros((task.history, task.frame_size))

    def copy(self) -> "History":
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


class PolicyMisfitError(PipelineError):
    """A policy whose sizes differ from those of the task."""

    def __init__(self, task: DeploymentTask, policy: Policy):
        got = f"{policy.observation_size} observations and {policy.action_size} actions"
        wanted = f"{task.observation_size} and {len(task.policy_joints)}"
        detail = f"{task.history} frames of {task.frame_size}"
        super().__init__(f"the policy has {got}; robot '{task.robot}' takes {wanted} ({detail}).")


class PolicyController:
    """Keeps history and last action of one rollout, called at `control_hz`. Raises PolicyMisfitError."""

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
        twin = PolicyController(self.task, self.policy)
        twin._history = self._history.copy()
        twin.last_action, twin.observation = self.last_action, self.observation
        return twin

    def targets(
        self,
        gyro_b: Float[np.ndarray, " 3"],
        gravity_b: Float[np.ndarray, " 3"],
        command: Float[np.ndarray, " 3"],
        joint_pos: Float[np.ndarray, " j"],
        joint_vel: Float[np.ndarray, " j"],
    ) -> Float[np.ndarray, " j"]:
        """Position targets [rad] of all joints in the robot's order; see `frame` for the arguments."""
        newest = frame(
            self.task,
            gyro_b=gyro_b,
            gravity_b=gravity_b,
            command=command,
            joint_pos=joint_pos,
            joint_vel=joint_vel,
            last_action=self.last_action,
        )
        self.observation = self._history.push(newest)
        self.last_action = self.policy.act(self.observation)
        targets = self.task.default_joint_pos.copy()
        targets[self.task.policy_index] += self.task.action_scale * self.last_action
        return targets
