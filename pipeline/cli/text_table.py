"""Aligned text: tables and name-value lists for a terminal."""

from collections.abc import Mapping, Sequence
from typing import Any


def text_table(header: Sequence[str], rows: Sequence[Sequence[Any]], indent: str = "") -> str:
    """Columns side by side, numbers to the right; the last column is not padded."""
    cells = [[_cell(value) for value in row] for row in rows]
    widths = [max(len(line[column]) for line in [list(header), *cells]) for column in range(len(header))]
    right = [bool(rows) and all(_is_number(row[column]) for row in rows) for column in range(len(header))]

    def line(values: Sequence[str]) -> str:
        padded = [
            value.rjust(width) if is_right else value.ljust(width)
            for value, width, is_right in zip(values, widths, right, strict=True)
        ]
        return (indent + "  ".join(padded)).rstrip()

    return "\n".join(line(values) for values in [list(header), *cells])


def name_values(values: Mapping[str, Any]) -> str:
    """A line a value, the names in a column."""
    width = max((len(name) for name in values), default=0)
    return "\n".join(f"{name.ljust(width)}  {_cell(value)}".rstrip() for name, value in values.items())


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return f"{round(value, 2) + 0.0:.2f}" if isinstance(value, float) else str(value)  # no negative zero


def _is_number(value: Any) -> bool:
    return value is None or (isinstance(value, (int, float)) and not isinstance(value, bool))
