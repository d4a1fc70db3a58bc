"""Write a robot folder with changed motor limits."""

from __future__ import annotations

import csv
import dataclasses
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import UnknownNameError
from pipeline.files import atomic
from pipeline.robot.build import build_robot
from pipeline.robot.checks import faults_of
from pipeline.robot.description import JOINTS, Description
from pipeline.robot.load import load_robot, model_files
from pipeline.robot.robot import Robot
from pipeline.robot.robot_error import refuse
from pipeline.robot.tables import JointRow


@dataclass(frozen=True, kw_only=True)
class MotorLimits:
    """Limits and armature of a joint's motor."""

    torque: float
    """[N m]"""
    speed: float
    """[rad/s]"""
    armature: float
    """[kg m^2]"""


def adapted_description(source: Description, limits: Mapping[str, MotorLimits]) -> Description:
    """The robot with other limits for some joints. Both speed columns become the motor's, so the URDF has it too.

    Raises UnknownNameError for an unknown joint, RobotError for invalid limits.
    """
    for name in limits:
        if name not in source.joint_rows:
            raise UnknownNameError("joint", name, list(source.joint_rows))
    rows = tuple(_with_limits(row, limits[row.joint]) if row.joint in limits else row for row in source.joints)
    adapted = dataclasses.replace(source, joints=rows, contents={**source.contents, JOINTS: joints_text(rows)})
    refuse(faults_of(adapted))
    return adapted


def _with_limits(row: JointRow, limits: MotorLimits) -> JointRow:
    return dataclasses.replace(
        row, torque=limits.torque, motor_speed=limits.speed, urdf_speed=limits.speed, armature=limits.armature
    )


def joints_text(rows: tuple[JointRow, ...]) -> str:
    """A joints table as the text of its file."""
    names = [field.name for field in dataclasses.fields(JointRow) if field.name != "line"]
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([_cell(getattr(row, name)) for name in names] for row in rows)
    return stream.getvalue()


def _cell(value: str | bool | float) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else repr(value).removesuffix(".0")


def write_robot_folder(folder: Path, description: Description) -> Robot:
    """Write tables and model files into `folder`, whose name becomes the robot's, and load it from there."""
    built = build_robot(dataclasses.replace(description, folder=folder))
    for name, text in description.contents.items():
        atomic.write_text(folder / name, text)
    for path, text in model_files(folder, built).items():
        atomic.write_text(path, text)
    return load_robot(folder)
