"""One trial: the command, the events, and the conditions of a rollout."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from pipeline.simulation.mujoco_plant import Ball
from pipeline.simulation.plant import Event
from pipeline.simulation.sensors import SensorNoise

SLEW = 1.0
"""Default rate limit of the command [m/s^2 or rad/s^2]."""


@dataclass(frozen=True, kw_only=True)
class VelocityCommand:
    """A velocity command that starts at a time."""

    start_s: float = 0.0
    forward: float = 0.0
    """[m/s]"""
    lateral: float = 0.0
    """To the left [m/s]."""
    yaw_rate: float = 0.0
    """[rad/s]"""

    @property
    def goal(self) -> tuple[float, float, float]:
        return self.forward, self.lateral, self.yaw_rate


@dataclass(frozen=True, kw_only=True)
class CommandProfile:
    """Consecutive velocity commands, starting from zero."""

    commands: tuple[VelocityCommand, ...]
    slew: float | None = SLEW
    """Rate limit of the command [m/s^2 or rad/s^2]; None: immediate."""

    def sampled(self, rate_hz: float, seconds: float) -> Float[np.ndarray, "k 3"]:
        """The command at each control step."""
        count = round(seconds * rate_hz)
        values, now = np.zeros((count, 3)), np.zeros(3)
        for step in range(count):
            goal = np.zeros(3)
            for each in self.commands:
                if step >= round(each.start_s * rate_hz):
                    goal = np.array(each.goal)
            most = np.inf if self.slew is None else (self.slew / rate_hz if step else 0.0)
            now = now + np.clip(goal - now, -most, most)
            values[step] = now
        return values

    @property
    def last(self) -> VelocityCommand:
        return self.commands[-1]


@dataclass(frozen=True, kw_only=True)
class GroundSpec:
    """A terrain by name and size; random terrain is sampled with the seed."""

    kind: str
    """`slope, cross_slope, bump, gravel, stones` or `rough`."""
    size: float
    """Angle [deg], rise, step, or amplitude [m]."""
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """Deviations from the nominal world and robot."""

    friction: float = 1.0
    root_mass_factor: float = 1.0
    gain_factor: float = 1.0
    """Factor on kp and kd."""
    delay_s: float = 0.0
    """Delay of the joint targets at the motors [s]."""
    noise: SensorNoise | None = None
    ground: GroundSpec | None = None
    ball: Ball | None = None


@dataclass(frozen=True, kw_only=True)
class Start:
    """Half widths of a random start around the default pose at rest, in m, rad, s; the feet are put on the ground."""

    joint_pos: float = 0.02
    joint_vel: float = 0.1
    lin_vel: float = 0.05
    ang_vel: float = 0.05
    tilt: float = 0.01
    """Roll and pitch [rad]."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """Definition of a rollout and of the time span that is measured."""

    seed: int
    """Seed of start, noise and random ground; seed 0 starts exactly from the default pose."""
    command: CommandProfile
    seconds: float
    measure_s: float
    """Figures are measured from this time to the end [s]."""
    events: tuple[Event, ...] = ()
    conditions: Conditions = field(default_factory=Conditions)
    start: Start = field(default_factory=Start)
