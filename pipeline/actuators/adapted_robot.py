"""Adapt a robot to its measured motors: limits for its model, and the table `actuators.csv`.

A limit changes only if a measurement contradicts it: a nominal value inside the measured 95 % interval is confirmed and
kept. So bench noise does not change the robot and the verdicts that depend on its limits.

Simulators have two forms of motor limits, with different meanings of "velocity limit". The box (the paper; Isaac
Lab's `effort_limit_sim`, `velocity_limit_sim`) holds torque and speed below the knee. The DC motor (Isaac Lab's
`DCMotor`, mjlab's `DcMotorActuator`) is a line from the saturation torque at rest to no torque at the no-load speed,
cut at the effort limit:

    torque <= min(effort limit, saturation (1 - speed / no-load speed))

It reaches the effort limit at the knee speed if saturation = knee torque / (1 - knee speed / no-load speed). With the
box's velocity limit as its no-load speed it would have no torque at the knee.
"""

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from pipeline.actuators.calibrate import Calibration
from pipeline.actuators.knee_fit import Interval
from pipeline.actuators.motor_table import MOTORS, MotorJointError
from pipeline.actuators.settings import ActuatorSettings
from pipeline.errors import FileError
from pipeline.files import atomic
from pipeline.files.csv_json import csv_records, plain_number, read_csv_text
from pipeline.robot import Robot
from pipeline.robot.adapted import MotorLimits, adapted_description, write_robot_folder
from pipeline.robot.load import read_description
from pipeline.simulation.torque_envelope import TorqueEnvelope

TABLE = "actuators.csv"
NO_MEASUREMENTS = "no measurements: nominal limits"
SYNTHETIC_SWEEP = "synthetic sweep: "
"""Start of the verdict on a joint whose sweep was never measured."""
UNBOUNDED = 1e9
"""A speed beyond any joint's [rad/s], used if the no-load speed is unknown: the torque does not fall."""


@dataclass(frozen=True, kw_only=True)
class BoxLimits:
    """The box form: limits below the knee."""

    box_effort_limit: float
    """Knee torque [N m]."""
    box_velocity_limit: float
    """Knee speed [rad/s]."""


def dc_motor_line(box: BoxLimits, no_load_speed: float) -> dict[str, float]:
    """The DC-motor form of a knee; NaN where the no-load speed is not known.

    `dc_motor_effort_limit`: knee torque [N m], `effort_limit` of mjlab and Isaac Lab
    `dc_motor_saturation_effort`: torque of the line at rest [N m], `saturation_effort`; the motor never reaches it
    `dc_motor_no_load_speed`: speed without torque [rad/s], `velocity_limit` of both

    Raises ValueError if the no-load speed is not above the knee speed.
    """
    names = ("dc_motor_effort_limit", "dc_motor_saturation_effort", "dc_motor_no_load_speed")
    if math.isnan(no_load_speed):
        return dict.fromkeys(names, math.nan)
    if not no_load_speed > box.box_velocity_limit:
        raise ValueError(f"no-load speed {no_load_speed:g} rad/s is not above the knee's {box.box_velocity_limit:g}.")
    saturation = box.box_effort_limit / (1.0 - box.box_velocity_limit / no_load_speed)
    return dict(zip(names, (box.box_effort_limit, saturation, no_load_speed), strict=True))


@dataclass(frozen=True, kw_only=True)
class JointActuator:
    """A joint's motor in the adapted robot. The fields are the columns of `actuators.csv`; NaN is an empty cell.

    Torques in N m, speeds in rad/s, armature in kg m^2, kp in N m/rad, kd in N m s/rad.
    """

    joint: str
    motor: str
    """Name of the motor in the motor table; empty without an entry."""
    verdict: str
    """Which limits were confirmed or changed, or why the measurement was not used."""
    box_effort_limit: float
    box_velocity_limit: float
    dc_motor_effort_limit: float
    dc_motor_saturation_effort: float
    dc_motor_no_load_speed: float
    armature: float
    kp: float
    kd: float
    measured_torque: float
    """At the knee, with its 95 % interval."""
    measured_torque_low: float
    measured_torque_high: float
    measured_speed: float
    """At the knee, with its 95 % interval."""
    measured_speed_low: float
    measured_speed_high: float
    nominal_torque: float
    nominal_speed: float
    nominal_armature: float

    @property
    def synthetic(self) -> bool:
        """Whether the limits come from a sweep that was never measured."""
        return self.verdict.startswith(SYNTHETIC_SWEEP)

    @property
    def changed(self) -> bool:
        """Whether any number differs from the nominal model's."""
        nominal = (self.nominal_torque, self.nominal_speed, self.nominal_armature)
        return (self.box_effort_limit, self.box_velocity_limit, self.armature) != nominal


def adapt(nominal: Robot, calibrations: Sequence[Calibration], settings: ActuatorSettings) -> tuple[JointActuator, ...]:
    """The actuators of the robot's joints, in its order. Raises MotorJointError for an unknown joint."""
    by_joint = {joint: each for each in calibrations for joint in each.joints}
    for joint, found in by_joint.items():
        if joint not in nominal.joint_names:
            raise MotorJointError(MOTORS, found.motor, joint, nominal)
    return tuple(_actuator(nominal, joint, by_joint.get(joint), settings) for joint in nominal.joint_names)


def _actuator(nominal: Robot, joint: str, found: Calibration | None, settings: ActuatorSettings) -> JointActuator:
    index = nominal.joint(joint)
    model = BoxLimits(
        box_effort_limit=float(nominal.torque_limit[index]), box_velocity_limit=float(nominal.motor_speed_limit[index])
    )
    box, no_load, verdict = _limits(model, found, settings)
    armature = float(nominal.armature[index])
    torque = speed = Interval(value=math.nan, low=math.nan, high=math.nan)
    if found and found.knee:
        torque, speed = found.knee.torque, found.knee.speed
    return JointActuator(
        joint=joint,
        motor=found.motor if found else "",
        verdict=verdict,
        **vars(box),
        **dc_motor_line(box, no_load),
        armature=armature if found is None or found.armature is None else found.armature,
        kp=float(nominal.kp[index]),
        kd=float(nominal.kd[index]),
        measured_torque=torque.value,
        measured_torque_low=torque.low,
        measured_torque_high=torque.high,
        measured_speed=speed.value,
        measured_speed_low=speed.low,
        measured_speed_high=speed.high,
        nominal_torque=model.box_effort_limit,
        nominal_speed=model.box_velocity_limit,
        nominal_armature=armature,
    )


def _limits(model: BoxLimits, found: Calibration | None, settings: ActuatorSettings) -> tuple[BoxLimits, float, str]:
    """Box limits, no-load speed (NaN if unknown) and verdict of a joint."""
    if found is None:
        return model, math.nan, NO_MEASUREMENTS
    if found.knee is None or found.reasons:
        return model, math.nan, f"nominal limits, {found.verdict}"
    knee = found.knee
    pairs = {"torque": (knee.torque, model.box_effort_limit), "speed": (knee.speed, model.box_velocity_limit)}
    for name, (measured, stated) in pairs.items():
        factor = max(measured.value / stated, stated / measured.value)
        if factor > settings.model.nominal_factor:
            text = f"a knee {name} of {measured.value:.2f} is {factor:.1f} times off the model's {stated:g}"
            return model, math.nan, f"nominal limits, refused: {text}; is it another unit or side?"
    chosen = {name: stated if stated in measured else measured.value for name, (measured, stated) in pairs.items()}
    words = [f"{name} {'confirmed' if chosen[name] == stated else 'changed'}" for name, (_, stated) in pairs.items()]
    box = BoxLimits(box_effort_limit=chosen["torque"], box_velocity_limit=chosen["speed"])
    return box, knee.no_load_speed, (SYNTHETIC_SWEEP if found.synthetic else "") + ", ".join(words)


def motors_source(actuators: Sequence[JointActuator]) -> str:
    """Origin of a robot's motor limits, for reports and cards: joints by kind of source."""
    synthetic = sum(each.synthetic for each in actuators)
    fitted = sum(not math.isnan(each.dc_motor_no_load_speed) for each in actuators)
    counts = {"measured": fitted - synthetic, "synthetic sweep, never measured": synthetic}
    counts["nominal"] = len(actuators) - fitted
    return ", ".join(f"{count} of {len(actuators)} joints {kind}" for kind, count in counts.items() if count)


def write_adapted_robot(folder: Path, nominal_folder: Path, actuators: Sequence[JointActuator]) -> Robot:
    """Write the adapted robot as a robot folder with `actuators.csv`, and load it.

    Joints without an accepted measurement keep the nominal values, except their armature.
    """
    description = read_description(nominal_folder)
    limits = {
        each.joint: MotorLimits(torque=each.box_effort_limit, speed=each.box_velocity_limit, armature=each.armature)
        for each in actuators
        if each.changed or not math.isnan(each.dc_motor_no_load_speed)
    }
    robot = write_robot_folder(folder, adapted_description(description, limits))
    atomic.write_text(folder / TABLE, actuators_text(actuators))
    return robot


def actuators_text(actuators: Sequence[JointActuator]) -> str:
    """The actuators as the text of `actuators.csv`."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([field.name for field in fields(JointActuator)])
    writer.writerows(["" if value != value else value for value in vars(each).values()] for each in actuators)
    return stream.getvalue()


def read_actuators(folder: Path) -> tuple[JointActuator, ...]:
    """The actuators of an adapted robot's folder. Raises FileError."""
    path = folder / TABLE
    if not path.is_file():
        raise FileError(path, "it is missing.", "Run: dagster asset materialize --select adapted_robot")
    types = {field.name: field.type for field in fields(JointActuator)}
    header, *rows = list(csv_records(read_csv_text(path).splitlines(), path)) or [[]]
    if not rows or set(header) != set(types):
        raise FileError(path, "its columns are not those of a table of actuators.", "Materialize adapted_robot again.")

    def value(name: str, cell: str) -> str | float:
        if types[name] is str:
            return cell
        return plain_number(cell) if cell else math.nan

    try:
        typed = [{name: value(name, cell) for name, cell in zip(header, row, strict=True)} for row in rows]
        return tuple(JointActuator(**row) for row in typed)  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError) as error:
        raise FileError(path, f"it is no table of actuators ({error}).", "Materialize adapted_robot again.") from error


def torque_envelope(actuators: Sequence[JointActuator]) -> TorqueEnvelope:
    """The torque envelope that a controller applies; MuJoCo has no joint speed limit."""
    known = np.array([not math.isnan(each.dc_motor_no_load_speed) for each in actuators])
    return TorqueEnvelope(
        limit=np.array([each.box_effort_limit for each in actuators]),
        knee_speed=np.where(known, [each.box_velocity_limit for each in actuators], UNBOUNDED),
        no_load_speed=np.where(known, [each.dc_motor_no_load_speed for each in actuators], 2.0 * UNBOUNDED),
    )
