"""The task of a policy that is exported: gains and default pose are those it was trained with, never another's."""

from __future__ import annotations

from pipeline.deployment import DeploymentTask, Policy, policy_task
from pipeline.export.export_error import ExportError
from pipeline.robot import Robot


def trained_task(robot: Robot, policy: Policy) -> DeploymentTask:
    """The deployment task of a robot with a policy's own gains.

    Raises ExportError for a policy that has none, UnknownNameError where it lacks a joint of the robot.
    """
    if policy.gains is None:
        raise ExportError("the policy has no gains; export it with the ones that it was trained with.")
    return policy_task(robot, policy)
