"""Result of a controller, parsed and validated as untrusted input."""

import json
from dataclasses import dataclass
from typing import Annotated, Any

from pipeline.errors import PipelineError
from pipeline.files.ranges import POSITIVE, Range, check
from pipeline.simulation.run import Segment
from pipeline.webots.booster_lab import FIGURES, SCHEMA


@dataclass(frozen=True, kw_only=True)
class WalkSegment(Segment):
    """A segment with a name, by which its thresholds are found."""

    name: str


@dataclass(frozen=True, kw_only=True)
class Allowed:
    """Largest deviation from a segment's command."""

    velocity_error_m_s: float
    yaw_rate_error_rad_s: float


@dataclass(frozen=True, kw_only=True)
class WebotsSettings:
    """The whole file."""

    timestep_ms: Annotated[float, Range(1.0, 5.0)]
    friction: Annotated[float, POSITIVE]
    measured_s: Annotated[float, POSITIVE]
    """Length of the end of each segment over which means are taken [s]."""
    limit_s: Annotated[float, POSITIVE]
    """Limit of wall-clock time [s]."""
    segments: tuple[WalkSegment, ...]

    def __post_init__(self) -> None:
        check([] if self.segments else [("segments", "is empty, allowed is one or more")])
        least_s = f"'measured_s' ({self.measured_s:g})"
        check(
            [
                (f"segments[{place}].seconds", f"is {each.seconds:g}, allowed is {least_s} or more")
                for place, each in enumerate(self.segments)
                if each.seconds < self.measured_s
            ]
        )


MAX_CHARACTERS = 1_000_000
MOST = 1e9
"""Maximum magnitude of a number."""


class ResultError(PipelineError):
    """A result that can't be used; `stale` if it belongs to another run."""

    def __init__(self, problem: str, stale: bool = False):
        self.stale = stale
        super().__init__(problem)


@dataclass(frozen=True, kw_only=True)
class WalkedSegment:
    """Means over the end of a segment; None if it was not walked to its end."""

    name: str
    walked: bool
    forward_m_s: float | None
    lateral_m_s: float | None
    yaw_rate_rad_s: float | None
    height_m: float | None

    @property
    def velocity(self) -> tuple[float, float, float]:
        """Forward and lateral [m/s], yaw rate [rad/s]; 0 if it was not walked."""
        return self.forward_m_s or 0.0, self.lateral_m_s or 0.0, self.yaw_rate_rad_s or 0.0


@dataclass(frozen=True, kw_only=True)
class WalkResult:
    """A walk in Webots or in a stand-in."""

    run: str
    timestep_ms: float
    seconds: float
    fell_s: float | None
    policy: bool
    """Whether a policy was active; otherwise the robot only held its default pose."""
    segments: tuple[WalkedSegment, ...]


def parse_result(text: str, run: str, names: tuple[str, ...]) -> WalkResult:
    """The result of the run `run` over the segments `names`. Raises ResultError."""
    if not text.strip():
        raise ResultError("the result is empty")
    if len(text) > MAX_CHARACTERS:
        raise ResultError(f"the result has {len(text)} characters, allowed are {MAX_CHARACTERS}")
    try:
        value = json.loads(text, parse_constant=_refused)
    except (ValueError, RecursionError) as error:
        raise ResultError(f"the result is not JSON ({error}): {text[:60]!r}") from error
    if not isinstance(value, dict) or value.get("schema") != SCHEMA:
        raise ResultError(f"the result is not an object of schema '{SCHEMA}'")
    if value.get("run") != run:
        raise ResultError(f"the result is of another run ({value.get('run')!r}, expected {run!r})", stale=True)
    rows = value.get("segments")
    if not isinstance(rows, list) or [row.get("name") if isinstance(row, dict) else None for row in rows] != [*names]:
        raise ResultError("the result's segments are not those of the plan")
    segments = []
    for row in rows:
        walked = row.get("walked") is True
        figures = {name: _number(row, name) if walked else None for name in FIGURES}
        segments.append(WalkedSegment(name=row["name"], walked=walked, **figures))
    return WalkResult(
        run=run,
        timestep_ms=_number(value, "timestep_ms"),
        seconds=_number(value, "seconds"),
        fell_s=None if value.get("fell_s") is None else _number(value, "fell_s"),
        policy=value.get("policy") is True,
        segments=tuple(segments),
    )


def _number(row: dict[str, Any], name: str) -> float:
    value = row.get(name)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= MOST:
        raise ResultError(f"the result's '{name}' is {repr(value)[:60]}, expected a number")
    return float(value)


def _refused(constant: str) -> None:
    raise ValueError(f"{constant} is not a number")
