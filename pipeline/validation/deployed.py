"""A policy on a robot: what every engine and every cell runs alike."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline.actuators import read_actuators, read_standing_pose, torque_envelope
from pipeline.actuators.adapted_robot import TABLE
from pipeline.deployment import DeploymentTask, Policy, PolicyController, policy_task
from pipeline.errors import FileError, PipelineError
from pipeline.robot import Robot, load_robot
from pipeline.simulation.pd_control import PdControl
from pipeline.simulation.sensors import PerfectSensors, Sensors
from pipeline.simulation.torque_envelope import TorqueEnvelope

ANKLE_KD = 2.0
"""With which Booster deploys its published walking policy, twice the robot's [N m s/rad]."""


class AnkleDampingError(PipelineError):
    """A damping of the ankles that can't be."""


@dataclass(frozen=True, kw_only=True)
class Deployed:
    """A policy on a robot with its gains and motors: what all engines run alike."""

    robot: Robot
    task: DeploymentTask
    policy: Policy
    envelope: TorqueEnvelope
    reads: Sensors = field(default_factory=PerfectSensors)
    """Without a memory of their own: all walks share them."""
    armature: Float[np.ndarray, " j"] | None = None
    """In MuJoCo, where it isn't the robot's [kg m^2]."""

    def gains(self) -> dict[str, dict[str, float]]:
        """Of each joint `kp` [N m/rad] and `kd` [N m s/rad]: a policy's digest says nothing of them."""
        pairs = zip(self.task.kp.tolist(), self.task.kd.tolist(), strict=True)
        return {name: {"kp": kp, "kd": kd} for name, (kp, kd) in zip(self.task.joint_names, pairs, strict=True)}

    def controller(self) -> PolicyController:
        return PolicyController(self.task, self.policy)

    def motors(self) -> PdControl:
        return PdControl(kp=self.task.kp, kd=self.task.kd, envelope=self.envelope)


def deployed(folder: Path, policy: Policy) -> Deployed:
    """A policy on the robot of a folder, with the measured motors where the folder is that of an adapted robot."""
    robot = load_robot(folder)
    adapted = (folder / TABLE).is_file()
    envelope = torque_envelope(read_actuators(folder)) if adapted else TorqueEnvelope(limit=robot.torque_limit)
    return Deployed(robot=robot, task=policy_task(robot, policy), policy=policy, envelope=envelope)


def anchor(folder: Path, policy: Policy) -> Deployed:
    """A policy on the model that the published figures were measured on: the manufacturer's armatures (none at hip and
    knee), constant torque limits, ankles damped as the manufacturer deploys its policy.

    Raises FileError for a robot whose folder doesn't have these armatures.
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


def with_ankle_kd(one: Deployed, kd: float) -> Deployed:
    """The same with another damping of the ankles [N m s/rad]. Raises AnkleDampingError."""
    ankles = np.array(["Ankle" in name for name in one.task.joint_names])
    if not (math.isfinite(kd) and kd >= 0.0):
        raise AnkleDampingError(f"the damping of the ankles is {kd:g} N m s/rad, allowed are numbers from 0 on.")
    task = dataclasses.replace(one.task, kd=np.where(ankles, kd, one.task.kd))
    return dataclasses.replace(one, task=task)
