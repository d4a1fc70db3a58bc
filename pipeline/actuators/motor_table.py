"""`motors.csv`: joints, gear and rotor of each motor, and the resulting armature."""

from dataclasses import dataclass
from pathlib import Path

from pipeline.actuators.settings import ModelSettings
from pipeline.errors import FileError
from pipeline.files.csv_json import csv_records, plain_integer, plain_number, read_csv_text
from pipeline.robot import Robot

MOTORS = "motors.csv"
COLUMNS = ("motor", "model", "joints", "motors_per_joint", "gear_ratio", "rotor_inertia [kg m^2]", "source")


@dataclass(frozen=True, kw_only=True)
class Motor:
    """A kind of drive, shared by all its joints."""

    name: str
    model: str
    joints: tuple[str, ...]
    motors_per_joint: int
    """2 if two motors drive one joint through parallel cranks, so that the joint turns both."""
    gear_ratio: float | None
    """None if it is not known, as is then the rotor's inertia."""
    rotor_inertia: float | None
    """[kg m^2]"""

    @property
    def armature(self) -> float | None:
        """Inertia of the rotors reflected to the joint [kg m^2]: n N^2 J_m (the paper's equation, n motors a joint).

        Rounded to 12 digits, so that published figures are reproduced. None without gear and rotor: the
        joints keep the armature of the robot's folder.
        """
        if self.gear_ratio is None or self.rotor_inertia is None:
            return None
        return float(f"{self.motors_per_joint * self.gear_ratio**2 * self.rotor_inertia:.12g}")


class MotorJointError(FileError):
    """Raised for a motor of the table with a joint that the robot lacks."""

    def __init__(self, path: Path | str, motor: str, joint: str, robot: Robot):
        problem = f"motor '{motor}' moves the joint '{joint}', which robot '{robot.name}' does not have."
        super().__init__(path, problem, f"Name joints of its joints.csv: {', '.join(robot.joint_names)}.")


def read_motors(path: Path, settings: ModelSettings) -> tuple[Motor, ...]:
    """The motor table. Raises FileError with the line."""
    every = read_csv_text(path).splitlines()
    lines = [line for line in every if not line.startswith("#")]
    offset = 1 + len(every) - len(lines)
    records = list(csv_records(lines, path, first_line=offset))
    if not records or tuple(records[0]) != COLUMNS:
        raise FileError(path, "its columns are not those of a motor table.", f"They must be {', '.join(COLUMNS)}.")
    motors = [_motor(record, path, line, settings) for line, record in enumerate(records[1:], start=offset + 1)]
    joints: dict[str, str] = {}
    for motor in motors:
        for joint in motor.joints:
            if joint in joints:
                raise FileError(path, f"'{joint}' is moved by '{joints[joint]}' and '{motor.name}'.", "Name one.")
            joints[joint] = motor.name
    if len({motor.name for motor in motors}) < len(motors):
        raise FileError(path, "a motor stands there twice.", "Write its joints in one row.")
    return tuple(motors)


def _motor(record: list[str], path: Path, line: int, settings: ModelSettings) -> Motor:
    if len(record) != len(COLUMNS):
        raise FileError(path, f"the row has {len(record)} values.", f"Write {len(COLUMNS)}.", line)
    name, model, joints, count, ratio, inertia, _ = record
    try:
        motor = Motor(
            name=name,
            model=model,
            joints=tuple(joints.split()),
            motors_per_joint=plain_integer(count),
            gear_ratio=plain_number(ratio) if ratio else None,
            rotor_inertia=plain_number(inertia) if inertia else None,
        )
    except ValueError as error:
        raise FileError(path, f"motor '{name}': {error}.", "Write numbers.", line) from error
    checks = (
        ("motors_per_joint", motor.motors_per_joint, (1, 2)),
        ("gear_ratio", motor.gear_ratio, settings.gear_ratio),
        ("rotor_inertia", motor.rotor_inertia, settings.rotor_inertia),
        ("the armature that follows", motor.armature, settings.armature),
    )
    if (motor.gear_ratio is None) != (motor.rotor_inertia is None):
        raise FileError(path, f"motor '{name}' has one of gear_ratio and rotor_inertia.", "Write both or none.", line)
    for what, value, (low, high) in checks:
        if value is not None and not low <= value <= high:
            problem = f"motor '{name}': {what} is {value:g}."
            raise FileError(path, problem, f"It must be {low:g} to {high:g}.", line)
    return motor
