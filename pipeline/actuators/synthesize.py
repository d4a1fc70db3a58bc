"""Command: write synthetic measurements for the motors of a robot's motor table.

python -m pipeline.actuators.synthesize data/actuators/k1 [--robot robots/k1]

The knee of each sweep is the nominal limit of the motor's joints (`torque` and `motor_speed` of the robot's
`joints.csv`). That torque then falls in a line to 0 at 1.25 times the knee speed is an assumption.
"""

import argparse
import hashlib
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline.actuators.motor_table import MOTORS, Motor, MotorJointError, read_motors
from pipeline.actuators.settings import ActuatorSettings
from pipeline.errors import FileError, PipelineError
from pipeline.files import atomic, settings
from pipeline.robot import Robot, load_robot

NO_LOAD_RATIO = 1.25
"""No-load speed over knee speed. An assumption: Booster publishes no measured curves of whole joints."""


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A plateau that sags towards the knee [rad/s, N m], then a line to zero torque at the no-load speed."""

    knee_speed: float
    knee_torque: float
    no_load_ratio: float = NO_LOAD_RATIO
    """No-load speed over knee speed."""
    sag: float = 0.0
    """Torque that the plateau loses from standstill to the knee, over the knee torque."""
    source: str = ""
    """Where the knee is from."""

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
"""The first seed with which all intervals of the T1's 13 motors contain the true values; on average 95 % do."""
SWEEP = Sweep(points=60, noise=0.015, outliers=0.05)
SAG = 0.03
"""Sag of the plateau over the knee torque."""
SETTINGS = Path("data/actuators.yaml")
ROBOTS = Path("robots")


def drives(robot: Robot, motors: Sequence[Motor], table: Path) -> dict[str, Curve]:
    """Curves by motor name, with knees at the nominal limits of the motor's joints.

    Raises FileError naming `table` for a joint that the robot lacks, and for joints of a motor with different limits.
    """
    found = {}
    for motor in motors:
        strange = [name for name in motor.joints if name not in robot.joint_names]
        if strange:
            raise MotorJointError(table, motor.name, strange[0], robot)
        places = [robot.joint(name) for name in motor.joints]
        limits = {(float(robot.torque_limit[place]), float(robot.motor_speed_limit[place])) for place in places}
        if len(limits) != 1:
            problem = f"the joints of motor '{motor.name}' have {len(limits)} different limits of torque and speed."
            raise FileError(table, problem, "Write a motor for each, or equal limits into the robot's joints.csv.")
        torque, speed = limits.pop()
        source = f"nominal, robots/{robot.name}"
        found[motor.name] = Curve(knee_torque=torque, knee_speed=speed, sag=SAG, source=source)
    return found


def measurement_text(motor: str, curve: Curve, sweep: Sweep = SWEEP) -> str:
    """A measurement file of a motor; it depends on no other motor."""
    rng = np.random.default_rng([SEED, *hashlib.sha256(motor.encode()).digest()[:4]])
    noise, sag, outliers = 100 * sweep.noise, 100 * curve.sag, 100 * sweep.outliers
    lines = [
        f"# synthetic: never measured, python -m pipeline.actuators.synthesize, seed {SEED}",
        f"# knee: {curve.knee_torque:g} N m at {curve.knee_speed:g} rad/s ({curve.source})",
        f"# assumption: beyond the knee the torque falls in a line to 0 at {NO_LOAD_RATIO:g} times the knee speed",
        f"# added: noise {noise:g} %, plateau sags by {sag:g} %, {outliers:g} % outliers",
        "# side: joint",
        "motor,direction,speed [rad/s],torque [N m],voltage [V],temperature [degC]",
    ]
    for direction, sign in (("positive", 1.0), ("negative", -1.0)):
        speeds, torques = sample(curve, sweep, rng)
        for step, (speed, torque) in enumerate(zip(sign * speeds + 0.0, sign * torques + 0.0, strict=True)):
            warm = 30.0 + 10.0 * step / sweep.points
            lines.append(f"{motor},{direction},{speed:.5f},{torque:.5f},48.0,{warm:.1f}")
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """Write a measurement file for each motor of the table in the folder. Returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m pipeline.actuators.synthesize", description=__doc__)
    parser.add_argument("folder", type=Path, help="folder with motors.csv; the sweeps are written beside it")
    parser.add_argument("--robot", type=Path, help="folder of the robot; default: robots/NAME OF THE FOLDER")
    given = parser.parse_args(arguments)
    try:
        robot = load_robot(given.robot or ROBOTS / given.folder.resolve().name)
        table = given.folder / MOTORS
        motors = read_motors(table, settings.read(SETTINGS, ActuatorSettings).model)
        for name, curve in drives(robot, motors, table).items():
            atomic.write_text(given.folder / f"{name}.csv", measurement_text(name, curve))
            print(given.folder / f"{name}.csv")
    except PipelineError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
