"""All checks of a robot folder."""

from collections.abc import Iterator
from pathlib import Path

from pipeline.errors import FileError
from pipeline.robot.build import build_robot
from pipeline.robot.description import Description
from pipeline.robot.load import model_files, read_description
from pipeline.robot.robot_error import RobotError
from pipeline.robot_check.body_checks import Finding, human_parts, key_links, masses, mirrored_figures, mirrored_sites
from pipeline.robot_check.compare import compare, model_of
from pipeline.robot_check.pose_checks import default_pose, drives, standing, step_stability
from pipeline.robot_import.read import read_model

SHOWN = 5
"""Most differences listed per file."""


def check_folder(folder: Path) -> list[Finding]:
    """Findings on a folder. The list ends with unreadable tables or with left and right that are not mirror images,
    since all other checks depend on these. Raises RobotError only if there is no folder."""
    folder = folder.resolve()
    if not folder.is_dir():
        read_description(folder)
    try:
        description = read_description(folder)
        robot = build_robot(description)
    except RobotError as error:
        return [Finding(code="tables", text=str(fault)) for fault in error.faults]
    found = [
        *masses(description, robot),
        *mirrored_figures(robot),
        *mirrored_sites(robot),
        *key_links(robot),
        *human_parts(robot),
        *default_pose(robot),
        *drives(robot),
        *step_stability(robot),
        *model_differences(folder, description, model_files(folder, robot)),
    ]
    return [*found, *standing(folder, robot)]


def model_differences(folder: Path, description: Description, files: dict[Path, str]) -> Iterator[Finding]:
    """Model files that are missing, cannot be read, or have other numbers than the tables."""
    for path, text in files.items():
        do = f"Run python -m pipeline.robot.render {folder}"
        if not path.is_file():
            yield Finding(code="model_files", text=f"{path.name} is missing. {do}")
            continue
        if path.read_text(encoding="utf-8", errors="replace") == text:
            continue
        try:
            found = compare(model_of(description, rendered=True), read_model(path))
        except FileError as error:
            yield Finding(code="model_files", text=f"{error} {do}")
            continue
        stated = [each for each in found if each.of_both]
        for each in stated[:SHOWN]:
            yield Finding(code="model_files", text=f"{path.name} differs from the tables: {each}")
        if len(stated) > SHOWN or not stated:
            rest = f"{len(stated) - SHOWN} further numbers" if stated else "only shapes, sites or names"
            yield Finding(code="model_files", text=f"{path.name} differs from the tables: {rest}. {do}")
