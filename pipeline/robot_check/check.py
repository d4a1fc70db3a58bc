"""All checks of a robot folder."""

from __future__ import annotations

from pathlib import Path

from pipeline.robot.build import build_robot
from pipeline.robot.load import model_files, read_description
from pipeline.robot.robot_error import RobotError
from pipeline.robot_check.body_checks import human_parts, key_links, masses
from pipeline.robot_check.finding import Finding
from pipeline.robot_check.mirror_checks import mirrored_figures, mirrored_sites
from pipeline.robot_check.model_checks import model_differences
from pipeline.robot_check.pose_checks import default_pose, drives, standing


def check_folder(folder: Path) -> list[Finding]:
    """Findings on a folder. Tables that cannot be read, or left and right that are no mirror images, end the list,
    since all other checks rest on them. Raises RobotError only where there is no folder."""
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
        *model_differences(folder, description, model_files(folder, robot)),
    ]
    return [*found, *standing(folder, robot)]
