"""Motors that stop answering: only damped from the operator's stop on, or without torque for a while."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float

from pipeline.robot import Robot
from pipeline.simulation.pd_control import PdControl
from pipeline.virtual_robot.deviations import by_joint


@dataclass(frozen=True, kw_only=True)
class Outage:
    """Motors that give no torque for a while, as if they were not enabled."""

    start_s: float
    stop_s: float = np.inf
    """Time at which they respond again [s]; infinite: never."""
    joints: tuple[str, ...] = ()
    """Joints whose motors are off; empty: all."""
    every_s: float = 0.0
    """Time from the beginning of one outage to that of the next [s]; 0: it happens once."""
    times: int = 1
    """How often it happens."""

    def is_off(self, time_s: float) -> bool:
        """Whether the motors are off at a time [s]."""
        starts = (self.start_s + count * self.every_s for count in range(self.times))
        return any(start <= time_s < start + self.stop_s - self.start_s for start in starts)

    def word(self) -> str:
        """The outage in words, for the log."""
        until = "the end" if self.stop_s == np.inf else f"{self.stop_s:g} s"
        again = f", {self.times} times" if self.times > 1 else ""
        return f"motors off from {self.start_s:g} s to {until}{again} ({', '.join(self.joints) or 'all'})"


@dataclass(frozen=True, kw_only=True)
class FailingMotors(PdControl):
    """PD control of motors that are off or damped at times. `torque` is called once a timestep, from time 0 on."""

    timestep_s: float
    stop_s: float = np.inf
    """When the operator stops the robot [s]: from then on the joints are only damped."""
    outages: tuple[tuple[Outage, Bool[np.ndarray, " j"]], ...] = ()
    """Each outage, and the joints that it is of."""
    clock: list[float] = field(default_factory=lambda: [0.0])

    def torque(self, target: np.ndarray, joint_pos: np.ndarray, joint_vel: np.ndarray) -> Float[np.ndarray, " j"]:
        """Torque [N m] (j,) of this timestep."""
        now = self.clock[0]
        self.clock[0] = now + self.timestep_s
        if now < self.stop_s:
            given = super().torque(target, joint_pos, joint_vel)
        else:
            given = self.envelope.clip(-self.kd * joint_vel, joint_vel)
        for outage, joints in self.outages:
            if outage.is_off(now):
                given = np.where(joints, 0.0, given)
        return given


def joints_of(robot: Robot, outage: Outage) -> Bool[np.ndarray, " j"]:
    """Which joints an outage is of. Raises UnknownNameError."""
    if not outage.joints:
        return np.ones(len(robot.joint_names), dtype=bool)
    return by_joint(robot, dict.fromkeys(outage.joints, 1.0), 0.0) > 0.0
