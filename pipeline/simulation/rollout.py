"""A walking policy in plain MuJoCo from rest, every force recorded."""

from __future__ import annotations

import numpy as np

from pipeline.deployment import Policy, PolicyController, deployment_task
from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.simulation.record import Rollout
from pipeline.simulation.run import Command, run
from pipeline.simulation.torque_envelope import PdControl

__all__ = ["Rollout", "rollout", "steady_command"]

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
