"""A policy deployed on a robot, shared by every engine and cell."""

import dataclasses
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from pipeline.actuators.adapted_robot import TABLE, read_actuators, torque_envelope
from pipeline.deployment import DeploymentTask, Policy, PolicyController, gains_by_joint, policy_task
from pipeline.errors import PipelineError
from pipeline.robot import Robot, load_robot
from pipeline.robot.legs import legs_of
from pipeline.simulation.plant import Plant
from pipeline.simulation.record import Rollout
from pipeline.simulation.run import Command, run
from pipeline.simulation.sensors import PerfectSensors, Sensors
from pipeline.simulation.torque_envelope import PdControl, TorqueEnvelope


class AnkleDampingError(PipelineError):
    """An invalid ankle damping."""


@dataclass(frozen=True, kw_only=True)
class Deployed:
    """A policy on a robot, with gains and motors. Raises PolicyMisfitError if the policy's sizes are not the task's."""

    robot: Robot
    task: DeploymentTask
    policy: Policy
    envelope: TorqueEnvelope
    reads: Sensors = field(default_factory=PerfectSensors)
    """Stateless sensors, shared by all rollouts."""
    armature: Float[np.ndarray, " j"] | None = None
    """Armature in MuJoCo if it differs from the robot's [kg m^2]."""

    def __post_init__(self) -> None:
        self.controller()  # raises errors here rather than in a worker

    def gains(self) -> dict[str, dict[str, float]]:
        """`kp` [N m/rad] and `kd` [N m s/rad] of each joint; they may be others than those in the policy's digest."""
        return gains_by_joint(self.task.joint_names, self.task.kp, self.task.kd)

    def controller(self) -> PolicyController:
        return PolicyController(self.task, self.policy)

    def motors(self) -> PdControl:
        return PdControl(kp=self.task.kp, kd=self.task.kd, envelope=self.envelope)

    def walk(self, plant: Plant, command: Command, seconds: float, **options: Any) -> Rollout:
        """The policy walks on a plant; `options` are those of `pipeline.simulation.run.run`."""
        motors, reads = self.motors(), self.reads
        return run(self.robot, plant, self.controller(), motors, command, seconds, sensors=reads, **options)


def deployed(folder: Path, policy: Policy) -> Deployed:
    """A policy on the robot of a folder, with measured motors if it is an adapted robot."""
    robot = load_robot(folder)
    adapted = (folder / TABLE).is_file()
    envelope = torque_envelope(read_actuators(folder)) if adapted else TorqueEnvelope(limit=robot.torque_limit)
    return Deployed(robot=robot, task=policy_task(robot, policy), policy=policy, envelope=envelope)


def with_ankle_kd(one: Deployed, kd: float) -> Deployed:
    """A copy with another ankle damping [N m s/rad]. Raises AnkleDampingError."""
    ankles = np.isin(np.arange(len(one.task.joint_names)), legs_of(one.robot).all_ankles)
    if not (math.isfinite(kd) and kd >= 0.0):
        raise AnkleDampingError(f"the damping of the ankles is {kd:g} N m s/rad, allowed are numbers from 0 on.")
    task = dataclasses.replace(one.task, kd=np.where(ankles, kd, one.task.kd))
    return dataclasses.replace(one, task=task)
