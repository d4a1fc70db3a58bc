"""Missed bars of a validation in its simulated logs: one note of the log, as JSON.

Only a log that is marked simulated is believed, and only a note that is sound from end to end: of a figure that is not
known, a number that can't be, or a bar that was not missed, nothing is taken at all.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from pipeline.hardware_logs.robot_log import LogFacts

NOTE = "missed bars"
"""Key of the note."""
CELL = re.compile(r"[A-Za-z0-9_ .,+-]{1,80}")
MOST_LETTERS, MOST_BARS = 20_000, 16
"""Of a note."""
MOST_SECONDS = 3600.0
MOST_SPEED = 100.0
"""Of a velocity that was commanded or reached [m/s or rad/s]."""


@dataclass(frozen=True, kw_only=True)
class KnownFigure:
    """A figure that a note may name."""

    unit: str
    most: float
    """Larger is no measurement."""
    lower_is_better: bool = True
    axes: tuple[str, ...] = ()
    """Where it is of a velocity: the axes that it may be off on."""


PLANE = ("forward", "lateral")
KNOWN: dict[str, KnownFigure] = {
    "falls": KnownFigure(unit="trials", most=1e5),
    "survival": KnownFigure(unit="share", most=1.0, lower_is_better=False),
    "speed_error": KnownFigure(unit="m/s", most=MOST_SPEED, axes=PLANE),
    "yaw_rate_error": KnownFigure(unit="rad/s", most=MOST_SPEED, axes=("yaw",)),
    "drift": KnownFigure(unit="m", most=1e3, axes=PLANE),
    "slip": KnownFigure(unit="m/s", most=MOST_SPEED),
    "saturation": KnownFigure(unit="%", most=100.0),
    "power": KnownFigure(unit="W", most=1e5),
    "steps": KnownFigure(unit="steps", most=1e4),
}


@dataclass(frozen=True, kw_only=True)
class MissedBar:
    """A figure of a simulated trial that missed its bar."""

    cell: str
    """Of the validation."""
    figure: str
    """One of `KNOWN`."""
    got: float
    """Of this trial; of falls and survival that of the cell's trials together. In the figure's unit, as the bar."""
    asked: float
    """The bar: at most or, where higher is better, at least."""
    from_s: float
    """What it was measured over, since the log's first message [s]; of a fall, when it was detected."""
    until_s: float
    axis: str = ""
    """`forward`, `lateral` or `yaw`: on which the velocity is off most."""
    commanded: float = 0.0
    """On that axis [m/s or rad/s]."""
    achieved: float = 0.0
    joint: str = ""
    """Of saturation: the joint that is at its limit most."""

    def __post_init__(self) -> None:
        _check(self)

    @property
    def bar(self) -> str:
        """As `at most 0.1 m/s`."""
        known = KNOWN[self.figure]
        return f"at {'most' if known.lower_is_better else 'least'} {self.asked:g} {known.unit}"

    def __str__(self) -> str:
        return f"{self.cell}: {self.figure.replace('_', ' ')} {self.got:.3g}, asked is {self.bar}"


def note_of(missed: Sequence[MissedBar]) -> dict[str, str]:
    """The note to put with a log's others; equal bars give equal text."""
    return {NOTE: json.dumps([asdict(each) for each in missed], sort_keys=True, allow_nan=False)}


def heard(facts: LogFacts, joint_names: Collection[str]) -> tuple[tuple[MissedBar, ...], tuple[str, ...]]:
    """The plausible missed bars that a log states, and a message about the others."""
    if NOTE not in facts.notes:
        return (), ()
    if not facts.simulated:
        return (), ("it states missed bars but not that it is simulated: they are left out.",)
    try:
        return of_text(facts.notes[NOTE], joint_names), ()
    except (ValueError, TypeError, OverflowError, RecursionError):
        return (), ("its missed bars can't be right and are left out.",)


def of_text(text: str, joint_names: Collection[str]) -> tuple[MissedBar, ...]:
    """The bars of a note. Raises ValueError, TypeError, OverflowError or RecursionError."""
    if len(text) > MOST_LETTERS:
        raise ValueError(f"{len(text)} letters, at most {MOST_LETTERS}")
    rows = json.loads(text)
    if not isinstance(rows, list) or len(rows) > MOST_BARS:
        raise ValueError(f"not a list of up to {MOST_BARS} bars")
    bars = tuple(_of_row(row) for row in rows)
    if strange := {each.joint for each in bars} - {"", *joint_names}:
        raise ValueError(f"no joints of the robot: {sorted(strange)}")
    return bars


def _of_row(row: Any) -> MissedBar:
    """Numbers as numbers, texts as texts; nothing is read into another type."""
    if not isinstance(row, dict):
        raise ValueError("a bar is an object")
    kinds = {each.name: each.type for each in fields(MissedBar)}
    facts: dict[str, Any] = {}
    for name, value in row.items():
        wanted = (int, float) if kinds.get(name) == "float" else str
        if name not in kinds or isinstance(value, bool) or not isinstance(value, wanted):
            raise ValueError(f"{name!r} is not a {kinds.get(name, 'field')}")
        facts[name] = value if isinstance(value, str) else float(value)
    return MissedBar(**facts)


def _check(bar: MissedBar) -> None:
    """Raises ValueError for what no validation writes."""
    known = KNOWN.get(bar.figure)
    if known is None:
        raise ValueError(f"no figure {bar.figure!r}; there are {', '.join(KNOWN)}")
    if not CELL.fullmatch(bar.cell):
        raise ValueError(f"no name of a cell: {bar.cell[:100]!r}")
    for value, most in ((bar.got, known.most), (bar.asked, known.most), (bar.until_s, MOST_SECONDS)):
        if not 0.0 <= value <= most:
            raise ValueError(f"{bar.figure}: {value:g} is not within 0 and {most:g}")
    if not 0.0 <= bar.from_s <= bar.until_s:
        raise ValueError(f"{bar.figure}: measured from {bar.from_s:g} to {bar.until_s:g} s")
    if (bar.got <= bar.asked) if known.lower_is_better else (bar.got >= bar.asked):
        raise ValueError(f"{bar.figure}: {bar.got:g} holds the bar {bar.asked:g}")
    if bar.axis not in (known.axes or ("",)):
        raise ValueError(f"{bar.figure} is not of the axis {bar.axis!r}")
    if not all(math.isfinite(each) and abs(each) <= MOST_SPEED for each in (bar.commanded, bar.achieved)):
        raise ValueError(f"{bar.figure}: velocities {bar.commanded:g} and {bar.achieved:g}")
    if bar.joint and bar.figure != "saturation":
        raise ValueError(f"{bar.figure} is not of a joint")
