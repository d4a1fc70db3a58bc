"""Rollouts of the published walking policy: robot motion that is known to be good."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.actuators.standing import read_standing_pose
from pipeline.deployment import Policy, PolicyController, deployment_task, load_policy, policy_task
from pipeline.errors import FileError
from pipeline.robot import Robot, load_robot
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.simulation.record import Rollout
from pipeline.simulation.run import Command, run
from pipeline.simulation.torque_envelope import PdControl, TorqueEnvelope
from pipeline.validation.deployed import Deployed, with_ankle_kd

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


def anchor(folder: Path, policy: Policy) -> Deployed:
    """A policy on the model of the published figures: the manufacturer's armatures (none at hip and knee), constant
    torque limits, ankle damping `ANKLE_KD`.

    Raises FileError if the robot's folder lacks these armatures.
    """
    robot = load_robot(folder)
    pose = read_standing_pose(folder, robot)
    if pose is None:
        raise FileError(folder / "standing.csv", "it is missing, and with it the manufacturer's armatures.")
    plain = Deployed(
        robot=robot,
        task=policy_task(robot, policy),
        policy=policy,
        envelope=TorqueEnvelope(limit=robot.torque_limit),
        armature=pose.vendor_armature,
    )
    return with_ankle_kd(plain, ANKLE_KD)
