"""Write a proposed robot folder."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

from pipeline.errors import FileError
from pipeline.robot import Robot, load_robot
from pipeline.robot.adapted import write_robot_folder
from pipeline.robot_import.propose import Proposal

README = "README.md"


def write_folder(folder: Path, proposal: Proposal, readme: str) -> Robot:
    """Write a new robot folder and load it. The whole folder appears at once.

    Raises FileError where the folder is there already, RobotError where it does not load.
    """
    if folder.exists():
        raise FileError(folder, "it exists already.", "Remove it, or choose another name or --out.")
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", dir=folder.parent) as aside:
        part = Path(aside) / folder.name
        description = dataclasses.replace(proposal.description, folder=part)
        write_robot_folder(part, description)
        (part / README).write_text(readme, encoding="utf-8")
        part.replace(folder)
    return load_robot(folder)
