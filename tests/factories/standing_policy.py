"""A policy that stands: the pose and gains that a robot's maker stands it with."""

from __future__ import annotations

from pipeline.actuators.standing import read_standing_pose
from pipeline.deployment import Policy, PolicyGains, deployment_task
from pipeline.robot import Robot
from pipeline.robot.load import ROBOTS
from tests.factories.policies import still_policy


def standing_policy(robot: Robot) -> Policy:
    """Action 0 about the pose of the robot's `standing.csv`, with its gains."""
    pose = read_standing_pose(ROBOTS / robot.name, robot)
    assert pose is not None
    gains = PolicyGains(joint_names=robot.joint_names, kp=pose.kp, kd=pose.kd, default_joint_pos=pose.joint_pos)
    return still_policy(deployment_task(robot), gains=gains)
