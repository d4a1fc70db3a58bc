"""Load a robot by name or by folder."""

from __future__ import annotations

from pathlib import Path

from pipeline.robot.build import build_robot
from pipeline.robot.read import read_description
from pipeline.robot.robot import Robot
from pipeline.robot.robot_error import Fault, refuse

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
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            problem = "the file is not what the tables beside it say."
            faults.append(Fault(path=path, problem=problem, do=f"Run python -m pipeline.robot.render {path.parent}"))
    refuse(faults)
    return built


def model_folder(robot: str | Path) -> Path:
    """The folder of a robot's name or path."""
    return ROBOTS / robot if isinstance(robot, str) else robot.resolve()


def model_files(folder: Path, robot: Robot) -> dict[Path, str]:
    """The model files of a robot folder and their expected content."""
    return {folder / f"{robot.name}.xml": robot.mjcf, folder / f"{robot.name}.urdf": robot.urdf}
