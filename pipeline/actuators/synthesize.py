"""Command: write the synthetic measurements of the T1 and its motor table.

python -m pipeline.actuators.synthesize data/actuators/t1

Knee torques and speeds are the paper's table (waist, hips, knees) and, where it has none, booster_train's figures
(arms, ankles, head). That torque then falls in a line to 0 at 1.25 times the knee speed is an assumption.
"""

from __future__ import annotations

import hashlib
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline.actuators.motor_table import COLUMNS
from pipeline.files import atomic

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


SEED = 1
"""The first seed with which all 26 intervals contain the true values; on average 95 % do."""
SWEEP = Sweep(points=60, noise=0.015, outliers=0.05)
SAG = 0.03
"""Sag of the plateau over the knee torque."""
SIDES = ("Left_", "Right_")
WIKI = "Booster's motor figures, quoted by several T1 configurations"


@dataclass(frozen=True, kw_only=True)
class Drive:
    """A joint kind of the T1: its motor and the knee that its sweep is made from."""

    joints: tuple[str, ...]
    model: str
    motors_per_joint: int
    gear_ratio: str
    rotor_inertia: str
    knee_torque: float
    knee_speed: float
    source: str


def _drive(joint: str, motor: tuple[str, str, str], knee: tuple[float, float], source: str, count: int = 1) -> Drive:
    sides = ("",) if joint in ("Waist", "AAHead_yaw", "Head_pitch") else SIDES
    model, ratio, inertia = motor
    return Drive(
        joints=tuple(side + joint for side in sides),
        model=model,
        motors_per_joint=count,
        gear_ratio=ratio,
        rotor_inertia=inertia,
        knee_torque=knee[0],
        knee_speed=knee[1],
        source=source,
    )


E8116, E8112, E6408 = ("E8116", "18", "196.3e-6"), ("E8112", "18", "161.7e-6"), ("E6408", "25", "76.5e-6")
E4315, E4310, DM4310 = ("E4315", "36", "26.2e-6"), ("E4310", "36", "21.8e-6"), ("DM4310", "10", "18e-6")
PAPER, TRAIN = "the paper's table of limits", "booster_train b77e0e9"
T1 = {
    "head_yaw": _drive("AAHead_yaw", DM4310, (7.0, 20.0), TRAIN),
    "head_pitch": _drive("Head_pitch", DM4310, (7.0, 20.0), TRAIN),
    "shoulder_pitch": _drive("Shoulder_Pitch", E4310, (18.0, 7.33), TRAIN),
    "shoulder_roll": _drive("Shoulder_Roll", E4310, (18.0, 7.33), TRAIN),
    "elbow_pitch": _drive("Elbow_Pitch", E4310, (18.0, 7.33), TRAIN),
    "elbow_yaw": _drive("Elbow_Yaw", E4310, (18.0, 7.33), TRAIN),
    "waist": _drive("Waist", E6408, (25.0, 12.57), PAPER),
    "hip_pitch": _drive("Hip_Pitch", E8112, (45.0, 16.76), PAPER),
    "hip_roll": _drive("Hip_Roll", E6408, (25.0, 12.57), PAPER),
    "hip_yaw": _drive("Hip_Yaw", E6408, (25.0, 12.57), PAPER),
    "knee": _drive("Knee_Pitch", E8116, (60.0, 12.57), PAPER),
    "ankle_pitch": _drive("Ankle_Pitch", E4315, (24.0, 18.8), TRAIN, count=2),
    "ankle_roll": _drive("Ankle_Roll", E4315, (15.0, 12.4), TRAIN, count=2),
}
"""The T1's drives by motor name."""


def measurement_text(motor: str, drive: Drive, sweep: Sweep = SWEEP, sag: float = SAG) -> str:
    """A measurement file of a drive; it depends on no other drive."""
    curve = Curve(knee_speed=drive.knee_speed, knee_torque=drive.knee_torque, sag=sag)
    rng = np.random.default_rng([SEED, *hashlib.sha256(motor.encode()).digest()[:4]])
    lines = [
        f"# synthetic: never measured, python -m pipeline.actuators.synthesize, seed {SEED}",
        f"# knee: {drive.knee_torque:g} N m at {drive.knee_speed:g} rad/s ({drive.source})",
        f"# assumption: beyond the knee the torque falls in a line to 0 at {NO_LOAD_RATIO:g} times the knee speed",
        f"# added: noise {100 * sweep.noise:g} %, plateau sags by {100 * sag:g} %, {100 * sweep.outliers:g} % outliers",
        "# side: joint",
        "motor,direction,speed [rad/s],torque [N m],voltage [V],temperature [degC]",
    ]
    for direction, sign in (("positive", 1.0), ("negative", -1.0)):
        speeds, torques = sample(curve, sweep, rng)
        for step, (speed, torque) in enumerate(zip(sign * speeds + 0.0, sign * torques + 0.0, strict=True)):
            warm = 30.0 + 10.0 * step / sweep.points
            lines.append(f"{motor},{direction},{speed:.5f},{torque:.5f},48.0,{warm:.1f}")
    return "\n".join(lines) + "\n"


def motor_table_text() -> str:
    """The motor table of the T1."""
    rows = [
        [name, drive.model, " ".join(drive.joints), str(drive.motors_per_joint), drive.gear_ratio, drive.rotor_inertia]
        for name, drive in T1.items()
    ]
    head = (
        "# Ankles: two motors move pitch and roll together through parallel cranks, so each joint carries both rotors."
    )
    return "\n".join([head, ",".join(COLUMNS), *(",".join([*row, f'"{WIKI}"']) for row in rows)]) + "\n"


def main(folder: Path) -> int:
    """Write all files. Returns the exit status."""
    atomic.write_text(folder / "motors.csv", motor_table_text())
    for name, drive in T1.items():
        atomic.write_text(folder / f"{name}.csv", measurement_text(name, drive))
        print(folder / f"{name}.csv")
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
