"""Missed bars (thresholds) of a validation, stored as a JSON note in its simulated logs.

The note is used only if the log is marked as simulated and the whole note is valid: an unknown figure, an impossible
number or a bar that was not missed invalidates all of it.
"""

import json
import math
import re
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass

from pydantic import ConfigDict, TypeAdapter

from pipeline.hardware_logs.robot_log import LogFacts

NOTE = "missed bars"
"""Key of the note."""
CELL = re.compile(r"[A-Za-z0-9_ .,+-]{1,80}")
MOST_LETTERS, MOST_BARS = 20_000, 16
"""Most characters and bars of a note."""
MOST_SECONDS = 3600.0
MOST_SPEED = 100.0
"""Largest plausible commanded or achieved velocity [m/s or rad/s]."""


@dataclass(frozen=True, kw_only=True)
class KnownFigure:
    """A figure that a note may contain."""

    unit: str
    most: float
    """Largest plausible value."""
    lower_is_better: bool = True
    axes: tuple[str, ...] = ()
    """Possible axes, for a figure of a velocity."""


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
    """Cell of the validation."""
    figure: str
    """One of `KNOWN`."""
    got: float
    """Value of this trial (falls and survival: of all trials of the cell), in the figure's unit."""
    asked: float
    """The threshold in the figure's unit: upper bound, or lower bound if higher is better."""
    from_s: float
    """Start of the measured time since the log's first message [s]; for a fall, the time of its detection."""
    until_s: float
    axis: str = ""
    """`forward`, `lateral` or `yaw`: axis with the largest velocity error."""
    commanded: float = 0.0
    """Commanded velocity on that axis [m/s or rad/s]."""
    achieved: float = 0.0
    joint: str = ""
    """For saturation: the joint that is most at its limit."""

    def __post_init__(self) -> None:
        """Raises ValueError for values that no validation writes."""
        known = KNOWN.get(self.figure)
        if known is None:
            raise ValueError(f"no figure {self.figure!r}; there are {', '.join(KNOWN)}")
        if not CELL.fullmatch(self.cell):
            raise ValueError(f"no name of a cell: {self.cell[:100]!r}")
        for value, most in ((self.got, known.most), (self.asked, known.most), (self.until_s, MOST_SECONDS)):
            if not 0.0 <= value <= most:
                raise ValueError(f"{self.figure}: {value:g} is not within 0 and {most:g}")
        if not 0.0 <= self.from_s <= self.until_s:
            raise ValueError(f"{self.figure}: measured from {self.from_s:g} to {self.until_s:g} s")
        if (self.got <= self.asked) if known.lower_is_better else (self.got >= self.asked):
            raise ValueError(f"{self.figure}: {self.got:g} holds the bar {self.asked:g}")
        if self.axis not in (known.axes or ("",)):
            raise ValueError(f"{self.figure} is not of the axis {self.axis!r}")
        if not all(math.isfinite(each) and abs(each) <= MOST_SPEED for each in (self.commanded, self.achieved)):
            raise ValueError(f"{self.figure}: velocities {self.commanded:g} and {self.achieved:g}")
        if self.joint and self.figure != "saturation":
            raise ValueError(f"{self.figure} is not of a joint")

    @property
    def bar(self) -> str:
        """The threshold as text, e.g. `at most 0.1 m/s`."""
        known = KNOWN[self.figure]
        return f"at {'most' if known.lower_is_better else 'least'} {self.asked:g} {known.unit}"

    def __str__(self) -> str:
        return f"{self.cell}: {self.figure.replace('_', ' ')} {self.got:.3g}, asked is {self.bar}"


def note_of(missed: Sequence[MissedBar]) -> dict[str, str]:
    """The note for a log's metadata; equal bars give equal text."""
    return {NOTE: json.dumps([asdict(each) for each in missed], sort_keys=True, allow_nan=False)}


def trusted_bars(facts: LogFacts, joint_names: Collection[str]) -> tuple[tuple[MissedBar, ...], tuple[str, ...]]:
    """The plausible missed bars that a log states, and a message about the others."""
    if NOTE not in facts.notes:
        return (), ()
    if not facts.simulated:
        return (), ("it states missed bars but not that it is simulated: they are left out.",)
    try:
        return of_text(facts.notes[NOTE], joint_names), ()
    except ValueError:
        return (), ("its missed bars can't be right and are left out.",)


_BARS = TypeAdapter(list[MissedBar], config=ConfigDict(strict=True, extra="forbid"))
"""Strict parser of a note: no type conversions."""


def of_text(text: str, joint_names: Collection[str]) -> tuple[MissedBar, ...]:
    """Parse the bars of a note. Raises ValueError."""
    if len(text) > MOST_LETTERS:
        raise ValueError(f"{len(text)} letters, at most {MOST_LETTERS}")
    bars = tuple(_BARS.validate_json(text))
    if len(bars) > MOST_BARS:
        raise ValueError(f"{len(bars)} bars, at most {MOST_BARS}")
    if strange := {each.joint for each in bars} - {"", *joint_names}:
        raise ValueError(f"no joints of the robot: {sorted(strange)}")
    return bars
