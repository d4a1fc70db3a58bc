"""The deployment task: joints, default pose, gains, rates."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Int

from pipeline.deployment.policy import Policy
from pipeline.errors import PipelineError, UnknownNameError

if TYPE_CHECKING:
    from pipeline.robot import Robot
else:  # the robot package imports MuJoCo, which is not needed on the robot
    Robot = Any

ACTION_SCALE = 0.25
"""Action scale of Booster's published walking policy and of this project's policies [rad]."""
HISTORY = 10
CONTROL_HZ = 50.0


@dataclass(frozen=True, kw_only=True)
class DeploymentTask:
    """Task with J joints in the robot's order; the policy moves A of them, in the network's order."""

    robot: str
    """Name of the robot."""
    joint_names: tuple[str, ...]
    """The J joints in hardware order, which is the order of all arrays except `policy_index`."""
    policy_joints: tuple[str, ...]
    """The A joints that the policy reads and moves, in the network's order."""
    default_joint_pos: Float[np.ndarray, " j"]
    """Offset of observed joint positions, and target of joints that the policy does not move [rad]."""
    kp: Float[np.ndarray, " j"]
    """[N m/rad]"""
    kd: Float[np.ndarray, " j"]
    """[N m s/rad]"""
    action_scale: float = ACTION_SCALE
    """Joint target per unit of action [rad]."""
    history: int = HISTORY
    """Frames in an observation."""
    control_hz: float = CONTROL_HZ

    @cached_property
    def policy_index(self) -> Int[np.ndarray, " a"]:
        """Indices of the policy's joints in `joint_names`."""
        return np.array([self.joint_names.index(name) for name in self.policy_joints])

    @property
    def frame_size(self) -> int:
        """Numbers in one frame of the observation."""
        return 9 + 3 * len(self.policy_joints)

    @property
    def observation_size(self) -> int:
        return self.history * self.frame_size


def deployment_task(
    robot: Robot,
    kp: Float[np.ndarray, " j"] | None = None,
    kd: Float[np.ndarray, " j"] | None = None,
    default_joint_pos: Float[np.ndarray, " j"] | None = None,
) -> DeploymentTask:
    """Build the task of a robot.

    Args:
        robot: joints and defaults
        kp: stiffness [N m/rad]; None: the robot's
        kd: damping [N m s/rad]; None: the robot's
        default_joint_pos: default pose [rad]; None: the robot's
    """
    return DeploymentTask(
        robot=robot.name,
        joint_names=robot.joint_names,
        policy_joints=robot.policy_joints,
        default_joint_pos=np.array(robot.default_joint_pos if default_joint_pos is None else default_joint_pos),
        kp=np.array(robot.kp if kp is None else kp),
        kd=np.array(robot.kd if kd is None else kd),
    )


class PolicyJointsError(PipelineError):
    """The joints of a policy's gains differ from the robot's."""

    def __init__(self, robot: Robot, names: Sequence[str]):
        lacking = [name for name in robot.joint_names if name not in names]
        foreign = [name for name in names if name not in robot.joint_names]
        has = f" and has {', '.join(foreign)}, which the robot does not have" if foreign else ""
        super().__init__(
            f"the policy does not fit robot '{robot.name}': it lacks the joints {', '.join(lacking)}{has}. "
            "Name the policy's robot with --robot."
        )


def policy_task(robot: Robot, policy: Policy) -> DeploymentTask:
    """Build the task with the policy's gains and default pose, else the robot's. Raises PolicyJointsError."""
    gains = policy.gains
    if gains is None:
        return deployment_task(robot)
    names = robot.own_names(gains.joint_names)
    if not set(robot.joint_names) <= set(names):
        raise PolicyJointsError(robot, names)
    kp, kd, default = (
        in_order(values, names, robot.joint_names) for values in (gains.kp, gains.kd, gains.default_joint_pos)
    )
    return deployment_task(robot, kp=kp, kd=kd, default_joint_pos=default)


def in_order(values: np.ndarray, names: Sequence[str], order: Sequence[str]) -> np.ndarray:
    """Reorder `values` of `names` to `order`. Raises UnknownNameError for a missing name."""
    indices = {name: index for index, name in enumerate(names)}
    for name in order:
        if name not in indices:
            raise UnknownNameError("joint", name, tuple(names))
    return np.asarray(values)[[indices[name] for name in order]]
