"""Synthetic torque-speed sweeps: a known curve with seeded noise, sag and outliers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

NO_LOAD_RATIO = 1.25
"""No-load speed over knee speed. An assumption: Booster publishes no measured curves of whole joints."""


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A plateau that sags towards the knee, then a line to zero torque at the no-load speed."""

    knee_speed: float
    """[rad/s]"""
    knee_torque: float
    """[N m]"""
    no_load_ratio: float = NO_LOAD_RATIO
    """No-load speed over knee speed."""
    sag: float = 0.0
    """Torque that the plateau loses from standstill to the knee, over the knee torque."""

    @property
    def no_load_speed(self) -> float:
        return self.no_load_ratio * self.knee_speed

    def torque(self, speed: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Torque [N m] at speeds [rad/s] between 0 and the no-load speed."""
        plateau = 1.0 + self.sag * (1.0 - speed / self.knee_speed)
        fall = (self.no_load_speed - speed) / (self.no_load_speed - self.knee_speed)
        return self.knee_torque * np.where(speed < self.knee_speed, plateau, fall)


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """Sampling of a curve."""

    points: int = 40
    noise: float = 0.02
    """Standard deviation of the torque over the knee torque."""
    outliers: float = 0.0
    """Share of points that are off by 20 to 50 % of the knee torque, either way."""
    end: float | None = None
    """Last speed over the knee speed; None for the no-load speed."""


def sample(curve: Curve, sweep: Sweep, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Evenly spaced speeds from 0 [rad/s], and measured torques [N m]."""
    end = curve.no_load_ratio if sweep.end is None else sweep.end
    speed = np.linspace(0.0, end * curve.knee_speed, sweep.points)
    torque = curve.torque(speed) + sweep.noise * curve.knee_torque * rng.standard_normal(sweep.points)
    wrong = rng.choice(sweep.points, size=round(sweep.outliers * sweep.points), replace=False)
    size = rng.uniform(0.2, 0.5, len(wrong)) * rng.choice([-1.0, 1.0], len(wrong))
    torque[wrong] += curve.knee_torque * size
    return speed, torque
