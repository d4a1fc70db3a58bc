"""Rollouts of the published walking policy: robot motion that is known to be good."""

from __future__ import annotations

from pathlib import Path

from pipeline.deployment import load_policy
from pipeline.robot import Robot
from pipeline.simulation.rollout import Rollout, rollout, steady_command
from pipeline.simulation.torque_envelope import PdControl, TorqueEnvelope

ANKLE_KD = 2.0
"""The gains this policy is deployed with have it twice as high as the robot's [N m s/rad]."""


def policy_walk(policies: Path, robot: Robot, command: tuple[float, float, float], seconds: float) -> Rollout:
    """The published policy walking by a constant command (forward, lateral, yaw rate) from rest."""
    kd = robot.kd.copy()
    kd[[index for index, name in enumerate(robot.joint_names) if "Ankle" in name]] = ANKLE_KD
    control = PdControl(kp=robot.kp, kd=kd, envelope=TorqueEnvelope(limit=robot.torque_limit))
    return rollout(robot, load_policy(policies / "t1_walk.npz"), control, steady_command(*command), seconds)
