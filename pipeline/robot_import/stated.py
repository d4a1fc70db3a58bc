"""Values stated by the user for a robot's joints: a CSV with the column `joint` and any columns of joints.csv."""

import io
from dataclasses import dataclass, field
from pathlib import Path

from pipeline.errors import FileError
from pipeline.files.csv_json import csv_records, read_csv_text
from pipeline.robot.tables import parse_cells

COLUMNS = ("lower", "upper", "urdf_speed", "motor_speed", "torque", "armature", "kp", "kd", "default_pos")
HINTS: dict[str, type] = {**dict.fromkeys(COLUMNS, float), "controlled": bool}


@dataclass(frozen=True, kw_only=True)
class Stated:
    """Values by column and joint, which override the model file and proposals."""

    path: Path | None = None
    numbers: dict[str, dict[str, float]] = field(default_factory=dict)
    controlled: dict[str, bool] = field(default_factory=dict)

    def value(self, column: str, joint: str) -> float | None:
        return self.numbers.get(column, {}).get(joint)


NOTHING = Stated()


def read_stated(path: Path, joints: tuple[str, ...]) -> Stated:
    """Read a table for the joints of a model. Empty cells state nothing. Raises FileError with the line."""
    if not path.is_file():
        raise FileError(path, "there is no such file.", "Name a CSV with the column joint.")
    rows = csv_records(io.StringIO(read_csv_text(path), newline=""), path)
    header = [name.strip() for name in next(rows, [])]
    unknown = [name for name in header[1:] if name not in HINTS]
    if not header or header[0] != "joint" or unknown or len(set(header)) < len(header):
        do = f"The first must be joint, the others of: controlled, {', '.join(COLUMNS)}."
        raise FileError(path, f"its columns are {', '.join(header) or 'missing'}.", do, line=1)
    numbers: dict[str, dict[str, float]] = {name: {} for name in header[1:] if name != "controlled"}
    controlled: dict[str, bool] = {}
    for line, row in enumerate(rows, start=2):
        if len(row) != len(header):
            raise FileError(path, f"the row has {len(row)} values.", f"Write {len(header)}.", line=line)
        joint, *cells = map(str.strip, row)
        if joint not in joints:
            raise FileError(path, f"there is no joint '{joint}'.", f"There are: {', '.join(joints)}.", line=line)
        given = {name: text for name, text in zip(header[1:], cells, strict=True) if text}
        values, problems = parse_cells(given, HINTS, ())
        if problems:
            faults = " ".join(f"{problem} {do}" for problem, do in problems)
            raise FileError(path, f"'{joint}': {faults}", line=line)
        for name, value in values.items():
            (controlled if name == "controlled" else numbers[name])[joint] = value
    return Stated(path=path, numbers=numbers, controlled=controlled)
