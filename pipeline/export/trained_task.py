"""The task of a policy with the gains and the default pose that it was trained with."""

from __future__ import annotations

from pipeline.deployment import DeploymentTask, Policy, deployment_task
from pipeline.deployment.task import in_order
from pipeline.export.export_error import ExportError
from pipeline.robot import Robot


def trained_task(robot: Robot, policy: Policy) -> DeploymentTask:
    """The deployment task of a robot with a policy's own gains.

    Raises ExportError for a policy that has none, UnknownNameError where it lacks a joint of the robot.
    """
    gains = policy.gains
    if gains is None:
        raise ExportError("the policy has no gains; export it with the ones that it was trained with.")
    arrays = {name: getattr(gains, name) for name in ("kp", "kd", "default_joint_pos")}
    mine = {name: in_order(values, gains.joint_names, robot.joint_names) for name, values in arrays.items()}
    return deployment_task(robot, **mine)
