"""The tables of a robot folder (CSV) as typed rows, with checks of single rows."""

import csv
import dataclasses
import io
import typing
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from pipeline.errors import FileError
from pipeline.files.csv_json import csv_records, plain_number, read_csv_text
from pipeline.robot.robot_error import RobotError, refuse


@dataclass(frozen=True, kw_only=True)
class Row:
    """A row of a table with its line. The first column names the row."""

    line: int
    """Line in the file, counted from 1."""
    positive: ClassVar[tuple[str, ...]] = ()
    """Columns that must be above zero."""

    @property
    def name(self) -> str:
        return getattr(self, dataclasses.fields(self)[1].name)

    def numbers(self, *columns: str) -> tuple[float, ...]:
        """Values of several number columns, in the given order."""
        return tuple(getattr(self, column) for column in columns)


@dataclass(frozen=True, kw_only=True)
class LinkRow(Row):
    """A link, the joint to its parent and its inertia. Lengths in m, angles in rad, mass in kg, inertia in kg m^2."""

    link: str
    parent: str
    """Empty for the root link, which has a free joint."""
    joint: str
    """Hinge joint to the parent; empty for the root link."""
    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float
    """Joint frame in the parent's link frame: position, then rotation about the fixed x, y, z axes (URDF)."""
    axis_x: float
    axis_y: float
    axis_z: float
    """Joint axis in the joint frame, unit length; zero for the root link."""
    mass: float
    com_x: float
    com_y: float
    com_z: float
    """Centre of mass in the link frame."""
    ixx: float
    ixy: float
    ixz: float
    iyy: float
    iyz: float
    izz: float
    """Inertia about the centre of mass, in the axes of the link frame."""
    positive: ClassVar[tuple[str, ...]] = ("mass", "ixx", "iyy", "izz")

    @property
    def inertia(self) -> Float[np.ndarray, "3 3"]:
        """Inertia about the centre of mass, in the axes of the link frame [kg m^2]."""
        xx, xy, xz, yy, yz, zz = self.numbers("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@dataclass(frozen=True, kw_only=True)
class JointRow(Row):
    """Limits and gains of a joint. The order of the rows is the order of joints everywhere."""

    joint: str
    controlled: bool
    """Whether the policy moves the joint; the others hold their default position."""
    lower: float
    upper: float
    """Position limits [rad]."""
    urdf_speed: float
    """Speed limit of the manufacturer's model [rad/s]."""
    motor_speed: float
    """Speed limit of the motor [rad/s]."""
    torque: float
    """Torque limit [N m]."""
    armature: float
    """Rotor inertia reflected to the joint [kg m^2]."""
    kp: float
    """[N m/rad]"""
    kd: float
    """[N m s/rad]"""
    default_pos: float
    """Position in the default pose [rad]."""
    positive: ClassVar[tuple[str, ...]] = ("urdf_speed", "motor_speed", "torque", "armature", "kp", "kd")

    @property
    def speed(self) -> float:
        """Speed that a motion may use [rad/s]: the smaller of the two limits."""
        return min(self.urdf_speed, self.motor_speed)


@dataclass(frozen=True, kw_only=True)
class ShapeRow(Row):
    """A primitive on a link, for collision, display, or both. Sizes and lengths in m, angles in rad.

    `size_a, size_b, size_c`: box half extents x, y, z; sphere radius; cylinder and capsule radius and
    half length along the local z axis (a capsule's caps come on top). Unused sizes are 0.
    """

    shape: str
    link: str
    kind: str
    role: str
    colour: str
    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float
    size_a: float
    size_b: float
    size_c: float

    @property
    def size(self) -> tuple[float, ...]:
        """The sizes used by the kind."""
        return (self.size_a, self.size_b, self.size_c)[: SHAPE_SIZES.get(self.kind, 0)]

    @property
    def long_axis(self) -> tuple[float, ...]:
        """Local z axis, the axis of cylinders and capsules, in the link frame."""
        turn = Rotation.from_euler("xyz", self.numbers("roll", "pitch", "yaw"))
        return tuple(turn.apply([0.0, 0.0, 1.0]).round(12).tolist())


SHAPE_SIZES = {"box": 3, "sphere": 1, "cylinder": 2, "capsule": 2}
SHAPE_ROLES = ("collision", "visual", "both")


@dataclass(frozen=True, kw_only=True)
class SiteRow(Row):
    """A named point fixed to a link, its axes those of the link."""

    site: str
    link: str
    x: float
    y: float
    z: float
    """Position in the link frame [m]."""
    source: str


def read_records(path: Path) -> list[list[str]]:
    """The rows of a CSV file. Raises RobotError."""
    try:
        return list(csv_records(io.StringIO(read_csv_text(path), newline=""), path))
    except FileError as error:
        raise RobotError([error]) from error


R = TypeVar("R", bound=Row)


def read_table(path: Path, kind: type[R]) -> tuple[R, ...]:
    """Rows of the CSV file `path`. Raises RobotError that names every faulty line."""
    if not path.is_file():
        refuse([FileError(path, "the file is missing.", "A robot folder needs it, see docs/robot.md.")])
    hints = {name: hint for name, hint in typing.get_type_hints(kind).items() if name not in ("line", "positive")}
    header, *records = read_records(path) or [[]]
    if header != list(hints):
        problem = f"the columns are {', '.join(header) or 'missing'}."
        refuse([FileError(path, problem, f"They must be {', '.join(hints)}.", line=1)])
    rows, faults = [], []
    for line, record in enumerate(records, start=2):
        if len(record) != len(hints):
            problem = f"the row has {len(record)} values."
            faults.append(FileError(path, problem, f"Write {len(hints)}, one a column.", line))
            continue
        values, problems = parse_cells(dict(zip(hints, record, strict=True)), hints, kind.positive)
        name = f"{next(iter(hints))} '{record[0]}'"
        faults += [FileError(path, f"{name}: {problem}", do, line) for problem, do in problems]
        if not problems:
            rows.append(kind(line=line, **values))
    refuse(faults + _repeated(path, rows))
    if not rows:
        refuse([FileError(path, "the table is empty.", "Write at least one row.")])
    return tuple(rows)


def table_text(kind: type[R], rows: Sequence[R]) -> str:
    """A table as the text of its file."""
    names = [field.name for field in dataclasses.fields(kind) if field.name != "line"]
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([_cell(getattr(row, name)) for name in names] for row in rows)
    return stream.getvalue()


def _cell(value: str | bool | float) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else repr(float(value)).removesuffix(".0")


def parse_cells(
    record: dict[str, str], hints: dict[str, type], positive: tuple[str, ...]
) -> tuple[dict[str, Any], list[tuple[str, str]]]:
    """Values of a record by column, and (problem, remedy) of each invalid value."""
    values: dict[str, Any] = {}
    problems = []
    for column, text in record.items():
        if hints[column] is float:
            try:
                values[column] = plain_number(text)
                if column in positive and values[column] <= 0.0:
                    problems.append((f"{column} is {text}.", "Write a number above 0."))
            except ValueError:
                problems.append((f"{column} is '{text}'.", "Write a finite number."))
        elif hints[column] is bool:
            if text not in ("yes", "no"):
                problems.append((f"{column} is '{text}'.", "Write yes or no."))
            values[column] = text == "yes"
        else:
            values[column] = text
    return values, problems


def _repeated(path: Path, rows: list[Any]) -> list[FileError]:
    first: dict[str, int] = {}
    faults = []
    for row in rows:
        if row.name in first:
            problem = f"'{row.name}' stands in line {first[row.name]} already."
            faults.append(FileError(path, problem, "Remove or rename one of them.", row.line))
        first.setdefault(row.name, row.line)
    return faults
