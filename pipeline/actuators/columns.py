"""The columns of a measurement file and their units."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from pipeline.errors import FileError

SPEED_UNITS = {
    "rad/s": 1.0,
    "deg/s": math.pi / 180.0,
    "°/s": math.pi / 180.0,
    "rpm": math.pi / 30.0,
    "1/min": math.pi / 30.0,
    "r/min": math.pi / 30.0,
}
TORQUE_UNITS = {"n m": 1.0, "nm": 1.0, "n·m": 1.0, "n*m": 1.0, "mn m": 1e-3, "mnm": 1e-3}
UNITS = {
    "motor": None,
    "direction": None,
    "speed": SPEED_UNITS,
    "torque": TORQUE_UNITS,
    "voltage": {"v": 1.0},
    "temperature": {"degc": 1.0, "°c": 1.0, "c": 1.0},
}
"""Units of each column and their factors to SI (temperature stays in degrees Celsius); None for text."""

_HEADER = re.compile(r"\s*([A-Za-z_ ]+?)\s*(?:[\[(]\s*(.+?)\s*[\])])?\s*")


@dataclass(frozen=True, kw_only=True)
class Column:
    """Index of a column and factor to SI."""

    index: int
    factor: float


def read_header(cells: list[str], file: str, line: int) -> dict[str, Column]:
    """Columns by name. Raises FileError for a missing column, a missing or an unknown unit."""
    columns: dict[str, Column] = {}
    for index, cell in enumerate(cells):
        match = _HEADER.fullmatch(cell)
        name = match.group(1).lower() if match else cell
        if name not in UNITS:
            do = f"There are: {', '.join(UNITS)}, with the unit in brackets."
            raise FileError(file, f"unknown column '{cell}'.", do, line)
        if name in columns:
            raise FileError(file, f"the column '{name}' stands there twice.", "Remove one.", line)
        columns[name] = Column(index=index, factor=_factor(name, match.group(2) if match else None, file, line))
    missing = [name for name in UNITS if name not in columns]
    if missing:
        raise FileError(file, f"the columns {', '.join(missing)} are missing.", "See docs/actuators.md.", line)
    return columns


def _factor(name: str, unit: str | None, file: str, line: int) -> float:
    units = UNITS[name]
    if units is None:
        return 1.0
    if unit is None:
        do = f"Write it in brackets: {name} [{next(iter(units))}]. Known: {', '.join(units)}."
        raise FileError(file, f"the column '{name}' has no unit.", do, line)
    if unit.lower() not in units:
        raise FileError(file, f"the column '{name}' has the unit '{unit}'.", f"Known: {', '.join(units)}.", line)
    return units[unit.lower()]
