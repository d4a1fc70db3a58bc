"""The command of a clip: levels of speed joined by smooth ramps, and the resulting path."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

GRID_HZ = 480.0
"""Planning rate [Hz]; every clip's rate divides it."""
LEAD_S = 3.0
"""Time planned before and after a clip, then cut off, so that no clip begins with a special step [s]."""


@dataclass(frozen=True, kw_only=True)
class Level:
    """A constant velocity, held for a time."""

    hold_s: float
    forward: float = 0.0
    """[m/s]"""
    lateral: float = 0.0
    """Positive to the left [m/s]."""
    yaw_rate: float = 0.0
    """Positive to the left [rad/s]."""

    @property
    def command(self) -> tuple[float, float, float]:
        return self.forward, self.lateral, self.yaw_rate


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """The definition of a clip."""

    name: str
    what: str
    """Description in one sentence."""
    levels: tuple[Level, ...]
    seed: int
    """Seed of the small differences between steps and clips."""
    gait: str = "walk"
    """`walk` (a foot is always on the ground; may stand) or `run` (2 m/s and more)."""
    ramp_s: float = 1.0
    """Time from one level to the next [s]."""
    fps: float = 60.0

    @property
    def frame_count(self) -> int:
        total_s = sum(level.hold_s for level in self.levels) + self.ramp_s * (len(self.levels) - 1)
        return round(total_s * self.fps) + 1


@dataclass(frozen=True, kw_only=True)
class Commands:
    """Commanded motion at `GRID_HZ`. World: x forward at the start, y left; the clip begins at time 0 in the origin."""

    times: Float[np.ndarray, " n"]
    """[s]"""
    forward: Float[np.ndarray, " n"]
    """[m/s]"""
    lateral: Float[np.ndarray, " n"]
    """[m/s]"""
    yaw_rate: Float[np.ndarray, " n"]
    """[rad/s]"""
    heading: Float[np.ndarray, " n"]
    """Integral of the yaw rate [rad]."""
    path_w: Float[np.ndarray, "n 2"]
    """Integral of the speeds along the heading [m]."""

    @property
    def moving(self) -> np.ndarray:
        """Whether any speed is commanded (n,)."""
        return np.abs(self.forward) + np.abs(self.lateral) + np.abs(self.yaw_rate) > 1e-9

    def at(self, values: Float[np.ndarray, " n"], time_s: float) -> float:
        """A grid array at a time by linear interpolation, extrapolated beyond the ends."""
        position = (time_s - self.times[0]) * GRID_HZ
        low = int(np.clip(np.floor(position), 0, len(values) - 2))
        return float(values[low] + (values[low + 1] - values[low]) * (position - low))

    def held(self, values: Float[np.ndarray, " n"], time_s: float) -> float:
        """A grid array at a time by linear interpolation, constant beyond the ends."""
        return self.at(values, float(np.clip(time_s, self.times[0], self.times[-1])))


def smoothstep(s: np.ndarray) -> np.ndarray:
    """0 to 1 over s in [0, 1], constant outside, twice continuously differentiable."""
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def plan_commands(recipe: Recipe) -> Commands:
    """Commanded speeds of a recipe over time and the resulting path, with lead-in and lead-out."""
    ends = round(LEAD_S * GRID_HZ)
    inside = round((recipe.frame_count - 1) * GRID_HZ / recipe.fps)
    times = np.arange(-ends, inside + ends + 1) / GRID_HZ
    command = np.tile(np.array(recipe.levels[0].command), (len(times), 1))
    start_s = 0.0
    for before, after in zip(recipe.levels[:-1], recipe.levels[1:], strict=True):
        start_s += before.hold_s
        change = np.array(after.command) - np.array(before.command)
        command += smoothstep((times - start_s) / recipe.ramp_s)[:, None] * change
        start_s += recipe.ramp_s
    command[np.abs(command) < 1e-12] = 0.0
    forward, lateral, yaw_rate = command.T.copy()
    heading = _integral(yaw_rate, ends)
    cosine, sine = np.cos(heading), np.sin(heading)
    velocity_w = np.stack([cosine * forward - sine * lateral, sine * forward + cosine * lateral], axis=-1)
    return Commands(
        times=times,
        forward=forward,
        lateral=lateral,
        yaw_rate=yaw_rate,
        heading=heading,
        path_w=_integral(velocity_w, ends),
    )


def _integral(rate: np.ndarray, zero_at: int) -> np.ndarray:
    """Trapezoidal integral over the grid (n, ...), zero at one index."""
    steps = 0.5 * (rate[1:] + rate[:-1]) / GRID_HZ
    total = np.concatenate([np.zeros((1, *rate.shape[1:])), np.cumsum(steps, axis=0)])
    return total - total[zero_at]
