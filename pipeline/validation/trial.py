"""One trial: what the policy is told, what happens to it, and in which world."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from pipeline.simulation.events import Event
from pipeline.simulation.mujoco_plant import Ball
from pipeline.simulation.sensors import SensorNoise

SLEW = 1.0
"""How fast a command goes to its next value where nothing else is said [m/s or rad/s a second]."""


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """A command from a time on."""

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
class Profile:
    """Commands one after the other, from zero."""

    wanted: tuple[Wanted, ...]
    slew: float | None = SLEW
    """How fast the command changes [m/s or rad/s a second]; None for at once."""

    def sampled(self, rate_hz: float, seconds: float) -> Float[np.ndarray, "k 3"]:
        """The command at each control step."""
        count = round(seconds * rate_hz)
        values, now = np.zeros((count, 3)), np.zeros(3)
        for step in range(count):
            goal = np.zeros(3)
            for each in self.wanted:
                if step >= round(each.start_s * rate_hz):
                    goal = np.array(each.goal)
            most = np.inf if self.slew is None else (self.slew / rate_hz if step else 0.0)
            now = now + np.clip(goal - now, -most, most)
            values[step] = now
        return values

    @property
    def last(self) -> Wanted:
        return self.wanted[-1]


@dataclass(frozen=True, kw_only=True)
class GroundSpec:
    """A terrain by name and numbers; what is random in it comes from the trial's seed."""

    kind: str
    """`slope, cross_slope, bump, gravel, stones` or `rough`."""
    size: float
    """Angle [deg], rise, step, or amplitude [m]."""
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """What differs from the nominal world and robot."""

    friction: float = 1.0
    root_mass_factor: float = 1.0
    gain_factor: float = 1.0
    """Of kp and kd."""
    delay_s: float = 0.0
    """How late joint targets reach the motors."""
    noise: SensorNoise | None = None
    ground: GroundSpec | None = None
    ball: Ball | None = None


@dataclass(frozen=True, kw_only=True)
class Start:
    """Half widths of what is drawn about the default pose at rest; the feet are put on the ground."""

    joint_pos: float = 0.02
    """[rad]"""
    joint_vel: float = 0.1
    """[rad/s]"""
    lin_vel: float = 0.05
    """[m/s]"""
    ang_vel: float = 0.05
    """[rad/s]"""
    tilt: float = 0.01
    """Roll and pitch [rad]."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """A rollout and when its figures begin."""

    seed: int
    """Of the start, of noise and of random ground; seed 0 starts from the default pose exactly."""
    command: Profile
    seconds: float
    measure_s: float
    """Figures are over the time from here to the end."""
    events: tuple[Event, ...] = ()
    conditions: Conditions = field(default_factory=Conditions)
    start: Start = field(default_factory=Start)
