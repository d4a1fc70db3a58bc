"""Measurement files of a motor whose knee is known, written in the ways that people write them."""

from __future__ import annotations

import numpy as np

from pipeline.actuators.motor_table import Motor
from pipeline.actuators.settings import ActuatorSettings
from pipeline.actuators.synthesize import Curve, Sweep, sample
from pipeline.files import settings
from pipeline.robot.load import ROBOTS

MOTOR = Motor(
    name="knee", model="E8116", joints=("Left_Knee_Pitch",), motors_per_joint=1, gear_ratio=18.0, rotor_inertia=196.3e-6
)
CURVE = Curve(knee_speed=12.57, knee_torque=60.0)
SETTINGS = settings.read(ROBOTS.parent / "data" / "actuators.yaml", ActuatorSettings)

CASES = {
    "noise of 2 %": (0.0, Sweep()),
    "noise of 5 %": (0.0, Sweep(noise=0.05)),
    "10 % outliers": (0.0, Sweep(outliers=0.1)),
    "sag of 8 %": (0.08, Sweep()),
    "12 points": (0.0, Sweep(points=12)),
}
"""Sag and sampling of each case that a knee must be found in."""


def points(sweep: Sweep = Sweep(), curve: Curve = CURVE, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:  # noqa: B008
    """Speeds [rad/s] and torques [N m] at the joint."""
    return sample(curve, sweep, np.random.default_rng(seed))


def written(
    speed: np.ndarray,
    torque: np.ndarray,
    *,
    about: str = "# side: joint",
    speed_unit: str = "rad/s",
    direction: str = "positive",
    separator: str = ",",
    decimal: str = ".",
) -> str:
    """The text of a measurement file."""
    names = ("motor", "direction", f"speed [{speed_unit}]", "torque [N m]", "voltage [V]", "temperature [degC]")
    lines = [about, separator.join(names)]
    for one, other in zip(speed, torque, strict=True):
        cells = ["knee", direction, *(f"{value:.6f}".replace(".", decimal) for value in (one, other, 48.0, 30.0))]
        lines.append(separator.join(cells))
    return "\n".join(lines) + "\n"
