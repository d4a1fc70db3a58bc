"""Text for a terminal: aligned tables, name-value lists, and the progress of a pool of processes on stderr."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.batch import ClipPool


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


EVERY_S = 2.0
"""Shortest time between two lines."""


@dataclass(frozen=True, kw_only=True)
class ReportingPool(ClipPool):
    """A `ClipPool` that prints how many of its calls are done and about how long the rest takes."""

    what: str
    """What the calls are, as `parts of the trials`."""

    def map(self, function: Callable[..., Any], calls: Sequence[tuple], **options: Any) -> Iterator[Any]:
        """Results in order, as they come, with a line about every `EVERY_S`."""
        started = last = time.monotonic()
        print(f"{self.what}: 0 of {len(calls)}", file=sys.stderr, flush=True)
        for count, result in enumerate(super().map(function, calls, **options), 1):
            yield result
            now = time.monotonic()
            if now - last >= EVERY_S or count == len(calls):
                last = now
                left_s = (now - started) / count * (len(calls) - count)
                rest = f", about {left_s:.0f} s left" if count < len(calls) else f", {now - started:.0f} s"
                print(f"{self.what}: {count} of {len(calls)}{rest}", file=sys.stderr, flush=True)
