"""Registration of KP5's criteria, as a decorator of the function that measures them.

    @criterion(Criterion("root_jerk", "smoothness", "root.jerk", "m/s^3", "mean jerk of the root", cuts=NOTHING))
    def root_jerk(motion: Motion, settings: RootSettings) -> tuple[Result, ...]: ...

Evaluation, the table of criteria, the docs, the benchmark and the asset's report use the registered criteria. A setting
states range and unit of its threshold:

    limit_excess: Annotated[float, Range(0.0, 1.0), Unit("rad")]

The YAML file states the same unit (`pipeline.files.sourced`); the range is checked on reading.
"""

import dataclasses
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from jaxtyping import Bool

from pipeline import time_series
from pipeline.clips.outcome import Reason
from pipeline.files.ranges import POSITIVE, SHARE, Range
from pipeline.files.sourced import JERK, LENGTH, SPEED_AND_SHARE, Unit

Seconds = Annotated[float, Range(0.0, 10.0), Unit("s")]
Hertz = Annotated[float, Range(1.0, 25.0), Unit("Hz")]
"""Cut-off of a low pass at the database's 50 Hz."""
Metres = Annotated[float, Range(0.0, 1.0), Unit("m"), LENGTH]
"""Scaled by the robot's leg length, as all settings with `LENGTH`, `SPEED` or `JERK` (`pipeline.robot.size`)."""
ToleranceMetres = Annotated[float, Range(0.0, 1.0), Unit("m")]
"""Tolerance of measurement or of the collision shapes: the same for every robot."""
ToleranceMetresPerSecond = Annotated[float, Range(0.0, 5.0), Unit("m/s")]
MetresPerSecondCubed = Annotated[float, POSITIVE, Unit("m/s^3"), JERK]
Degrees = Annotated[float, Range(0.0, 180.0), Unit("deg")]
ShareOfFrames = Annotated[float, SHARE, Unit("of frames")]
RatioToMotorLimit = Annotated[float, Range(0.5, 5.0), Unit("of the motor's limit")]
MetresPerSecondBySpeed = Annotated[tuple[float, float], Range(0.0, 5.0), Unit("m/s"), SPEED_AND_SHARE]
"""Limit [a, b]: a + b times the horizontal speed."""
SecondsBySpeed = Annotated[tuple[float, float], Range(0.0, 10.0), Unit("s")]
"""Limit [a, b]: a + b times the horizontal speed."""


MOTION, NUMBERS, LENGTH = "motion", "numbers", "length"
"""Input of a criterion: a motion, the numbers of earlier stages, or the length of a stretch."""

FRAMES, WHOLE_CLIP, NOTHING = "frames", "whole clip", "–"
"""What a failed criterion removes: frames, the clip, or nothing. Without frames to cut, the stretch is rejected."""

ORDER = (
    *("tracking stability", "root motion", "joint and speed limits", "torque", "contact consistency", "foot slip"),
    *("penetration", "self-collision", "contact forces", "smoothness", "likeness to the person", "length"),
)
"""Order of the groups in tables; further groups follow."""


@dataclass(frozen=True)
class Criterion:
    """A criterion; its number is stored with a clip under `code`."""

    code: str
    group: str
    limit: str
    """Key of its threshold in `data/feasibility.yaml`, e.g. `joints.limit_excess`. The function gets the section."""
    unit: str
    what: str
    """Short description of the number, for the docs."""
    cuts: str = field(kw_only=True, default=FRAMES)
    lower: bool = field(kw_only=True, default=False)
    """Whether the limit is a lower bound."""
    of: str = field(kw_only=True, default=MOTION)

    @property
    def section(self) -> str:
        """The section of the file that holds the threshold."""
        return self.limit.partition(".")[0]


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """A number compared with its limit."""

    code: str
    value: float
    limit: float
    text: str
    """Sentence on the measured value and its time, without the limit."""
    bad: Bool[np.ndarray, " t"] | None = field(default=None, repr=False)
    """Mask of the frames to cut so that the rest may pass; None if the criterion marks no frames."""
    not_applicable: str = ""
    """Why the criterion does not apply (nothing to measure); empty if it does."""

    @property
    def unit(self) -> str:
        return REGISTERED[self.code].unit

    @property
    def lower(self) -> bool:
        return REGISTERED[self.code].lower

    @property
    def holds(self) -> bool:
        return self.value >= self.limit if self.lower else self.value <= self.limit

    def reason(self, fps: float, start_s: float, stop_s: float) -> Reason:
        """The reason for rejecting or cutting the stretch `start_s` ... `stop_s` [s] of a clip."""
        spans = time_series.runs(self.bad) if self.bad is not None else []
        if spans:
            start_s, stop_s = start_s + spans[0][0] / fps, start_s + spans[-1][1] / fps
        allowed = f"{'at least' if self.lower else 'at most'} {self.limit:.3g} {self.unit}".rstrip()
        return Reason(
            code=self.code,
            text=f"{self.text}; {allowed} is allowed.",
            effect="rejected",
            start_s=start_s,
            stop_s=stop_s,
            value=self.value,
            limit=self.limit,
            unit=self.unit,
        )


@dataclass(frozen=True, kw_only=True)
class Skipped:
    """A criterion that does not apply to a motion, and why; it counts neither as passed nor as failed."""

    code: str
    not_applicable: str
    holds: bool = True


Result = Verdict | Skipped

REGISTERED: dict[str, Criterion] = {}
"""Code -> criterion, in the order of registration."""

MEASURES: dict[Callable[..., tuple[Result, ...]], tuple[Criterion, ...]] = {}
"""Function -> its criteria; each call returns one result per criterion."""


def criterion(*criteria: Criterion) -> Callable[[Any], Any]:
    """Register the criteria of a function: `function(motion, section)` or `function(numbers, section)`. Raises
    ValueError for a code that is already registered."""

    def register(function: Any) -> Any:
        for each in criteria:
            if each.code in REGISTERED:
                raise ValueError(f"the criterion '{each.code}' is registered twice")
            REGISTERED[each.code] = each
        MEASURES[function] = criteria
        return function

    return register


def results(evidence: Any, settings: Any, of: str, only: Collection[str] = ()) -> Iterator[Result]:
    """Results of all registered criteria with the input `of`, in the order of the settings' sections.

    Args:
        evidence: the motion or the numbers, according to `of`
        settings: `FeasibilitySettings`; each function gets its section
        of: `MOTION` or `NUMBERS`
        only: codes of the criteria to evaluate; empty for all
    """
    place = {each.name: index for index, each in enumerate(dataclasses.fields(settings))}
    measures = [
        (criteria[0].section, function, criteria)
        for function, criteria in MEASURES.items()
        if criteria[0].of == of and (not only or any(each.code in only for each in criteria))
    ]
    for section, function, criteria in sorted(measures, key=lambda measure: place[measure[0]]):
        found = function(evidence, getattr(settings, section))
        assert [each.code for each in found] == [each.code for each in criteria], function.__name__
        yield from found


def groups() -> dict[str, tuple[str, ...]]:
    """Group -> codes of its criteria, in the order of the tables."""
    found: dict[str, list[str]] = {name: [] for name in ORDER}
    for code, each in REGISTERED.items():
        found.setdefault(each.group, []).append(code)
    return {name: tuple(own) for name, own in found.items()}


def codes() -> list[str]:
    """Codes of all criteria, in the order of the tables."""
    return [code for group in groups().values() for code in group]
