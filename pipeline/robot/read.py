"""Read a robot folder and check it."""

from __future__ import annotations

import tomllib
from pathlib import Path

from pipeline.errors import SettingsError
from pipeline.files import settings
from pipeline.robot.checks import faults_of
from pipeline.robot.description import CONFIG, FILES, JOINTS, LINKS, SHAPES, SITES, Config, Description
from pipeline.robot.robot_error import Fault, RobotError, refuse
from pipeline.robot.tables import JointRow, LinkRow, ShapeRow, SiteRow, read_table


def read_description(folder: Path) -> Description:
    """Read and check a robot folder. Raises RobotError with every fault of the first file that has one."""
    if not folder.is_dir():
        known = ", ".join(sorted(path.parent.name for path in folder.parent.glob(f"*/{CONFIG}"))) or "none"
        do = f"Name one of the robots of {folder.parent} ({known}) or a folder."
        refuse([Fault(path=folder, problem="there is no such robot folder.", do=do)])
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
    return description


def _read_config(path: Path) -> Config:
    do = "See docs/robot.md for what it holds."
    if not path.is_file():
        refuse([Fault(path=path, problem="the file is missing.", do=do)])
    try:
        return settings.parse(Config, tomllib.loads(path.read_text(encoding="utf-8")), path)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RobotError([Fault(path=path, problem=f"it is not TOML ({error}).", do=do)]) from error
    except SettingsError as error:
        raise RobotError([Fault(path=path, problem=error.problem, do=do)]) from error
