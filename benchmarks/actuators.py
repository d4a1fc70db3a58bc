"""Recovery of known torque-speed knees, rejected fits and interval coverage; the T1's standing test.

    python benchmarks/actuators.py [--draws 1000] [--json]

Each case is drawn `draws` times: knee speed 5 to 20 rad/s and torque 5 to 60 N m at random, no-load speed 1.25 times
that of the knee. Sweeps are fitted and rejected like those of a file.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline.actuators.adapted_robot import adapt, torque_envelope  # noqa: E402
from pipeline.actuators.calibrate import (  # noqa: E402
    calibrate,
    fit_sweep,
    reasons_against,
)
from pipeline.actuators.motor_table import read_motors  # noqa: E402
from pipeline.actuators.read_measurement import Measurement  # noqa: E402
from pipeline.actuators.settings import ActuatorSettings  # noqa: E402
from pipeline.actuators.standing import StandingResult, read_standing_pose, stand  # noqa: E402
from pipeline.actuators.synthesize import Curve, Sweep, sample  # noqa: E402
from pipeline.batch import ClipPool  # noqa: E402
from pipeline.files import settings as settings_file  # noqa: E402
from pipeline.robot import load_robot  # noqa: E402

SEED = 20
KNEES = {
    "2 % noise": (0.0, Sweep()),
    "5 % noise": (0.0, Sweep(noise=0.05)),
    "10 % outliers": (0.0, Sweep(outliers=0.1)),
    "8 % sag": (0.08, Sweep()),
    "12 points": (0.0, Sweep(points=12)),
}
NO_FALLS = {
    "ends at the knee": (0.0, Sweep(end=1.0)),
    "ends at the knee, 8 % sag": (0.08, Sweep(end=1.0)),
    "ends at the knee, 5 % noise": (0.0, Sweep(end=1.0, noise=0.05)),
    "ends at the knee, 10 % outliers": (0.0, Sweep(end=1.0, outliers=0.1)),
    "ends at the knee, 12 points": (0.0, Sweep(end=1.0, points=12)),
    "ends at 0.7 of it": (0.0, Sweep(end=0.7)),
}
"""Voltage sag and sampling of each case."""


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """Results of one case; pairs are (speed, torque)."""

    errors: np.ndarray
    inside: np.ndarray
    refused: float


def draw(sag: float, sweep: Sweep, draws: int, seed: list[int], values: ActuatorSettings) -> Drawn:
    """Draw a case."""
    rng = np.random.default_rng(seed)
    errors, inside, refused = [], [], 0
    for _ in range(draws):
        curve = Curve(knee_speed=rng.uniform(5.0, 20.0), knee_torque=rng.uniform(5.0, 60.0), sag=sag)
        speed, torque = sample(curve, sweep, rng)
        measurement = Measurement(
            speed=speed, torque=torque, forward=np.ones(len(speed), dtype=bool), about={}, notes=()
        )
        measurement, fit = fit_sweep(measurement, values.knee)
        found, truth = (fit.knee_speed, fit.knee_torque), (curve.knee_speed, curve.knee_torque)
        errors.append([abs(each.value / true - 1.0) for each, true in zip(found, truth, strict=True)])
        inside.append([true in each for each, true in zip(found, truth, strict=True)])
        refused += bool(reasons_against(measurement, fit, values.knee))
    return Drawn(errors=np.array(errors), inside=np.array(inside), refused=refused / draws)


def knee_bars(draws: int, values: ActuatorSettings) -> list[Bar]:
    """Recovery, rejections and coverage of all cases."""
    cases = [*KNEES.values(), *NO_FALLS.values()]
    calls = [(sag, sweep, draws, [SEED, number], values) for number, (sag, sweep) in enumerate(cases)]
    found = list(ClipPool().map(draw, calls))
    bars = []
    for name, each in zip(KNEES, found, strict=False):
        for column, what in enumerate(("speed", "torque")):
            error, inside = 100.0 * each.errors[:, column], 100.0 * each.inside[:, column].mean()
            bars += [
                Bar(name=f"{name}: {what}, median", value=float(np.median(error)), unit="%", sense="<=", bound=1.0),
                Bar(name=f"{name}: {what}, p90", value=float(np.quantile(error, 0.9)), unit="%", sense="<=", bound=3.0),
                Bar(name=f"{name}: {what} in interval", value=float(inside), unit="%", sense=">=", bound=90.0),
            ]
        bars.append(Bar(name=f"{name}: refused", value=100.0 * each.refused, unit="%", sense="<=", bound=2.0))
    for name, each in zip(NO_FALLS, found[len(KNEES) :], strict=True):
        bars.append(Bar(name=f"{name}: refused", value=100.0 * each.refused, unit="%", sense=">=", bound=95.0))
    pooled = 100.0 * np.concatenate([each.inside for each in found[: len(KNEES)]]).mean(axis=0)
    for value, what in zip(pooled, ("speed", "torque"), strict=True):
        bars.append(Bar(name=f"all cases: {what} in interval", value=float(value), unit="%", sense=">=", bound=93.0))
        bars.append(Bar(name=f"all cases: {what} in interval", value=float(value), unit="%", sense="<=", bound=97.0))
    return bars


def robot_bars(values: ActuatorSettings) -> list[Bar]:
    """The shipped sweeps and the standing test."""
    folder, robot = ROOT / "data/actuators/t1", load_robot("t1")
    motors = read_motors(folder / "motors.csv", values.model)
    found = [calibrate((folder / f"{each.name}.csv").read_text(), each.name, each, values) for each in motors]
    actuators = adapt(robot, found, values)
    known = [each for each in actuators if each.measured_torque == each.measured_torque]
    off = [abs(each.measured_torque / each.nominal_torque - 1.0) for each in known]
    off += [abs(each.measured_speed / each.nominal_speed - 1.0) for each in known]
    inside = [each.measured_torque_low <= each.nominal_torque <= each.measured_torque_high for each in known]
    inside += [each.measured_speed_low <= each.nominal_speed <= each.measured_speed_high for each in known]
    pose, armature = read_standing_pose(ROOT / "robots/t1", robot), np.array([each.armature for each in actuators])
    assert pose is not None
    envelope = torque_envelope(actuators)
    ours = stand(robot, pose, envelope, armature)
    falls = {"no armature": 0.0 * armature, "vendor MJCF's armature": pose.vendor_armature}
    return [
        Bar(name="shipped sweeps: joints measured", value=len(known), sense=">=", bound=23),
        Bar(name="shipped sweeps: worst knee", value=100.0 * max(off), unit="%", sense="<=", bound=1.5),
        Bar(
            name="shipped sweeps: table in interval",
            value=100.0 * float(np.mean(inside)),
            unit="%",
            sense=">=",
            bound=100.0,
        ),
        Bar(name="adapted T1 stands", value=0.0 if ours.fell else ours.seconds, unit="s", sense=">=", bound=10.0),
        Bar(name="adapted T1 tilts", value=ours.tilt_deg, unit="deg", sense="<=", bound=1.0),
        *(
            Bar(
                name=f"T1 with {name} falls after",
                value=_falls_after(stand(robot, pose, envelope, each)),
                unit="s",
                sense="<=",
                bound=10.0,
            )
            for name, each in falls.items()
        ),
    ]


def _falls_after(stood: StandingResult) -> float:
    return stood.seconds if stood.fell else float("inf")


def main() -> int:
    """Print the table; 0 when all bars hold."""
    parser = argparse.ArgumentParser(description="Recovery of planted knees, refusals, coverage; the standing test.")
    parser.add_argument("--draws", type=int, default=1000, help="draws a case")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    values = settings_file.read(ROOT / "data" / "actuators.yaml", ActuatorSettings)
    bars = [*knee_bars(arguments.draws, values), *robot_bars(values)]
    return 0 if report(bars, machine=machine(), json=arguments.json) else 1


if __name__ == "__main__":
    sys.exit(main())
