"""Rollouts of the published walking policy: robot motion that is known to be good."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.deployment import Policy, PolicyController, deployment_task, load_policy
from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.simulation.record import Rollout
from pipeline.simulation.run import Command, run
from pipeline.simulation.torque_envelope import PdControl, TorqueEnvelope

COMMAND_SLEW = 1.0
"""How fast the command goes from standing to its value [m/s or rad/s a second]."""


def rollout(
    robot: Robot, policy: Policy, control: PdControl, command: Command, seconds: float, timestep_s: float = 0.005
) -> Rollout:
    """Walk for `seconds` from the default pose on flat ground; joints the policy doesn't have are held at their
    default."""
    task = deployment_task(robot, control.kp, control.kd)
    plant = MujocoPlant(robot, MujocoOptions(timestep_s=timestep_s))
    return run(robot, plant, PolicyController(task, policy), control, command, seconds)


def steady_command(forward: float, lateral: float, yaw_rate: float) -> Command:
    """A command that is slewed from zero to its value and kept."""
    goal = np.array([forward, lateral, yaw_rate])
    return lambda time_s: np.clip(goal, -COMMAND_SLEW * time_s, COMMAND_SLEW * time_s)


ANKLE_KD = 2.0
"""The gains this policy is deployed with have it twice as high as the robot's [N m s/rad]."""


def policy_walk(policies: Path, robot: Robot, command: tuple[float, float, float], seconds: float) -> Rollout:
    """The published policy walking by a constant command (forward, lateral, yaw rate) from rest."""
    kd = robot.kd.copy()
    kd[[index for index, name in enumerate(robot.joint_names) if "Ankle" in name]] = ANKLE_KD
    control = PdControl(kp=robot.kp, kd=kd, envelope=TorqueEnvelope(limit=robot.torque_limit))
    return rollout(robot, load_policy(policies / "t1_walk.npz"), control, steady_command(*command), seconds)
