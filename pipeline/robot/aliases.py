"""Other names of a robot's joints: the optional `aliases.csv` of its folder.

    joint,booster_2026
    Left_Knee_Pitch,left_knee_pitch_joint

Each further column is a naming: that of a newer model file, of recordings, of another deployment program. It is no part
of the robot's digest, since it changes nothing that is computed.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

from pipeline.errors import FileError
from pipeline.files.csv_json import csv_records, read_csv_text
from pipeline.robot.robot_error import Fault, refuse

ALIASES = "aliases.csv"


def read_aliases(folder: Path, joints: Sequence[str]) -> tuple[dict[str, tuple[str, ...]], str]:
    """Names of the joints in their order by naming, and the text of the file; none without a file. Raises RobotError
    with every fault."""
    path = folder / ALIASES
    if not path.is_file():
        return {}, ""
    try:
        text = read_csv_text(path)
        records = list(csv_records(io.StringIO(text, newline=""), path))
    except FileError as error:
        refuse([Fault(path=path, line=error.line, problem=error.problem, do=error.do)])
        raise
    header, rows = (records[0], records[1:]) if records else ([], [])
    if len(header) < 2 or header[0] != "joint" or len(set(header)) < len(header) or not all(header):
        problem = f"the columns are {', '.join(header) or 'missing'}."
        refuse([Fault(path=path, line=1, problem=problem, do="They must be joint and the name of each naming.")])
    refuse([_width(path, line, header, row) for line, row in enumerate(rows, start=2) if len(row) != len(header)])
    if [row[0] for row in rows] != list(joints):
        problem = "the joints are not those of joints.csv in their order."
        refuse([Fault(path=path, problem=problem, do=f"Write a row for each of: {', '.join(joints)}.")])
    namings = {name: tuple(row[place] for row in rows) for place, name in enumerate(header) if place}
    refuse(_unclear(path, joints, namings))
    return namings, text


def _width(path: Path, line: int, header: list[str], row: list[str]) -> Fault:
    return Fault(path=path, line=line, problem=f"the row has {len(row)} values.", do=f"Write {len(header)}.")


def _unclear(path: Path, joints: Sequence[str], namings: dict[str, tuple[str, ...]]) -> list[Fault]:
    """Names that are empty or stand for two joints."""
    owner = {joint: joint for joint in joints}
    faults = []
    for names in namings.values():
        for line, (joint, name) in enumerate(zip(joints, names, strict=True), start=2):
            if not name.strip() or owner.setdefault(name, joint) != joint:
                both = f"'{name}' stands for '{joint}', and for '{owner.get(name)}'."
                problem = both if name.strip() else f"'{joint}' has no name."
                faults.append(Fault(path=path, line=line, problem=problem, do="Give each joint a name of its own."))
    return faults
