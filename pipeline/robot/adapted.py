"""Write a robot folder with changed motor limits."""

import dataclasses
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import UnknownNameError
from pipeline.files import atomic
from pipeline.robot.build import build_robot
from pipeline.robot.checks import faults_of
from pipeline.robot.description import ALIASES, CONFIG, JOINTS, LINKS, SHAPES, SITES, Config, Description
from pipeline.robot.load import load_robot, model_files
from pipeline.robot.robot import Robot
from pipeline.robot.robot_error import refuse
from pipeline.robot.tables import JointRow, LinkRow, ShapeRow, SiteRow, table_text


@dataclass(frozen=True, kw_only=True)
class MotorLimits:
    """Limits [N m, rad/s] and armature [kg m^2] of a joint's motor."""

    torque: float
    speed: float
    armature: float
    """[kg m^2]"""


def adapted_description(source: Description, limits: Mapping[str, MotorLimits]) -> Description:
    """The robot with other limits for some joints. Both speed columns are set to the motor's, so that the URDF has it,
    too.

    Raises UnknownNameError for an unknown joint, RobotError for invalid limits.
    """
    for name in limits:
        if name not in source.joint_rows:
            raise UnknownNameError("joint", name, list(source.joint_rows))
    rows = list(source.joints)
    for place, row in enumerate(rows):
        if new := limits.get(row.joint):
            speeds = {"motor_speed": new.speed, "urdf_speed": new.speed}
            rows[place] = dataclasses.replace(row, torque=new.torque, armature=new.armature, **speeds)
    contents = {**source.contents, JOINTS: table_text(JointRow, rows)}
    adapted = dataclasses.replace(source, joints=tuple(rows), contents=contents)
    refuse(faults_of(adapted))
    return adapted


def files_of(description: Description) -> dict[str, str]:
    """The source files of a robot folder by name, from the rows of a description."""
    return {
        CONFIG: config_text(description.config),
        LINKS: table_text(LinkRow, description.links),
        JOINTS: table_text(JointRow, description.joints),
        SHAPES: table_text(ShapeRow, description.shapes),
        SITES: table_text(SiteRow, description.sites),
    }


def config_text(config: Config) -> str:
    """`robot.toml`. Names and numbers are written in JSON notation, which is valid TOML."""
    lines = ["# What the tables beside this file do not state. Keys: pipeline/robot/description.py.", ""]
    for field in dataclasses.fields(Config):
        value = getattr(config, field.name)
        if not isinstance(value, dict):
            lines.append(f"{field.name} = {json.dumps(value)}")
    for table in ("colours", "human_links"):
        lines += ["", f"[{table}]"]
        lines += [f"{_key(key)} = {json.dumps(value)}" for key, value in getattr(config, table).items()]
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name)


def write_robot_folder(folder: Path, description: Description) -> Robot:
    """Write tables and model files into `folder`, and load the robot from there; its name is the folder's."""
    built = build_robot(dataclasses.replace(description, folder=folder))
    for name, text in description.contents.items():
        atomic.write_text(folder / name, text)
    if description.aliases_text:
        atomic.write_text(folder / ALIASES, description.aliases_text)
    for path, text in model_files(folder, built).items():
        atomic.write_text(path, text)
    return load_robot(folder)
