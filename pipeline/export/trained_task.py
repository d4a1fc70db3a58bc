"""The task of an exported policy, with the gains and default pose that it was trained with."""

from __future__ import annotations

from pipeline.deployment import DeploymentTask, Policy, policy_task
from pipeline.export.export_error import ExportError
from pipeline.robot import Robot


def trained_task(robot: Robot, policy: Policy) -> DeploymentTask:
    """The deployment task of a robot with a policy's own gains.

    Raises ExportError for a policy without gains, UnknownNameError if it lacks a joint of the robot.
    """
    if policy.gains is None:
        raise ExportError("the policy has no gains; export it with the ones that it was trained with.")
    return policy_task(robot, policy)
