"""Load a robot by name or by folder."""

import dataclasses
import tomllib
from pathlib import Path

from pipeline.errors import FileError, SettingsError
from pipeline.files import settings
from pipeline.robot.build import build_robot
from pipeline.robot.checks import faults_of
from pipeline.robot.description import CONFIG, FILES, JOINTS, LINKS, SHAPES, SITES, Config, Description, read_aliases
from pipeline.robot.robot import Robot
from pipeline.robot.robot_error import RobotError, refuse
from pipeline.robot.tables import JointRow, LinkRow, ShapeRow, SiteRow, read_table


def read_description(folder: Path) -> Description:
    """Read and check a robot folder. Raises RobotError with every fault of the first file that has one."""
    if not folder.is_dir():
        known = ", ".join(sorted(path.parent.name for path in folder.parent.glob(f"*/{CONFIG}"))) or "none"
        do = f"Name one of the robots of {folder.parent} ({known}) or a folder."
        refuse([FileError(folder, "there is no such robot folder.", do)])
    description = Description(
        folder=folder,
        config=_read_config(folder / CONFIG),
        links=read_table(folder / LINKS, LinkRow),
        joints=read_table(folder / JOINTS, JointRow),
        shapes=read_table(folder / SHAPES, ShapeRow),
        sites=read_table(folder / SITES, SiteRow),
        contents={name: (folder / name).read_text(encoding="utf-8") for name in FILES},
    )
    refuse(faults_of(description))
    namings, text = read_aliases(folder, [row.joint for row in description.joints])
    return dataclasses.replace(description, namings=namings, aliases_text=text)


def _read_config(path: Path) -> Config:
    do = "See docs/robot.md for what it holds."
    if not path.is_file():
        refuse([FileError(path, "the file is missing.", do)])
    try:
        return settings.parse(Config, tomllib.loads(path.read_text(encoding="utf-8")), path)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RobotError([FileError(path, f"it is not TOML ({error}).", do)]) from error
    except SettingsError as error:
        raise RobotError([FileError(path, error.problem, do)]) from error


ROBOTS = Path(__file__).resolve().parents[2] / "robots"
"""Folder of the project's robots."""


def robot_names() -> tuple[str, ...]:
    """Names of the robots in `ROBOTS`, sorted."""
    return tuple(sorted(path.parent.name for path in ROBOTS.glob("*/robot.toml")))


def load_robot(robot: str | Path) -> Robot:
    """The robot of a name in `robots/` or of a folder.

    Raises RobotError if the folder has faults, or if its MJCF or URDF differs from its tables.
    """
    built = build_robot(read_description(model_folder(robot)))
    faults = []
    for path, text in model_files(model_folder(robot), built).items():
        if not path.is_file() or path.read_bytes() != text.encode():
            problem = "the file is not what the tables beside it say."
            faults.append(FileError(path, problem, f"Run python -m pipeline.robot.render {path.parent}"))
    refuse(faults)
    return built


def model_folder(robot: str | Path) -> Path:
    """The folder of a robot given by name or path."""
    return ROBOTS / robot if isinstance(robot, str) else robot.resolve()


def model_files(folder: Path, robot: Robot) -> dict[Path, str]:
    """The model files of a robot folder and their expected content."""
    return {folder / f"{robot.name}.xml": robot.mjcf, folder / f"{robot.name}.urdf": robot.urdf}
