"""Types of the numbers in `data/feasibility.yaml`: unit and allowed range are part of a field's annotation.

    limit_excess: Annotated[float, Unit("rad"), Range(0.0, 1.0)]

The file states the same unit (`pipeline.files.sourced`); a `Section` checks the range.
"""

from __future__ import annotations

import functools
import typing
from dataclasses import dataclass
from typing import Annotated

from pipeline.files.ranges import POSITIVE, SHARE, Allowed, Range, check
from pipeline.files.sourced import JERK, LENGTH, SPEED_AND_SHARE, Unit

Seconds = Annotated[float, Unit("s"), Range(0.0, 10.0)]
Hertz = Annotated[float, Unit("Hz"), Range(1.0, 25.0)]
"""Cut-off of a low pass at the database's 50 Hz."""
Metres = Annotated[float, Unit("m"), Range(0.0, 1.0), LENGTH]
"""Scales with the robot's legs, as all figures with `LENGTH`, `SPEED` or `JERK` do (`pipeline.robot.size`)."""
ToleranceMetres = Annotated[float, Unit("m"), Range(0.0, 1.0)]
"""Of measurement or of the shapes' accuracy: the same for every robot."""
ToleranceMetresPerSecond = Annotated[float, Unit("m/s"), Range(0.0, 5.0)]
MetresPerSecondCubed = Annotated[float, Unit("m/s^3"), POSITIVE, JERK]
Degrees = Annotated[float, Unit("deg"), Range(0.0, 180.0)]
ShareOfFrames = Annotated[float, Unit("of frames"), SHARE]
RatioToMotorLimit = Annotated[float, Unit("of the motor's limit"), Range(0.5, 5.0)]
MetresPerSecondBySpeed = Annotated[tuple[float, float], Unit("m/s"), Range(0.0, 5.0), SPEED_AND_SHARE]
"""a + b times the speed over ground."""
SecondsBySpeed = Annotated[tuple[float, float], Unit("s"), Range(0.0, 10.0)]
"""a + b times the speed over ground."""


@dataclass(frozen=True, kw_only=True)
class Section:
    """A section of the file. It checks the ranges of its fields and raises RangeError with every fault."""

    def __post_init__(self) -> None:
        check(self, self.further_faults(), **_allowed(type(self)))

    def further_faults(self) -> list[tuple[str, str]]:
        """Faults between fields, each a field's name and a sentence without it."""
        return []


@functools.cache
def _allowed(kind: type[Section]) -> dict[str, Allowed]:
    """What each field of a section may be, from its annotation."""
    hints = typing.get_type_hints(kind, include_extras=True)
    return {
        name: remark
        for name, hint in hints.items()
        for remark in getattr(hint, "__metadata__", ())
        if isinstance(remark, Allowed)
    }
