"""Settings of `data/webots.yaml`: commands and world. The thresholds are in `robots/<robot>/validation.yaml`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pipeline.files.ranges import NOT_NEGATIVE, POSITIVE, Range, check


@dataclass(frozen=True, kw_only=True)
class WalkSegment:
    """A segment with one commanded velocity."""

    name: str
    seconds: Annotated[float, POSITIVE]
    command: tuple[float, float, float]
    """Forward and lateral [m/s], yaw rate [rad/s]."""
    slew: Annotated[float, NOT_NEGATIVE] = 1.0
    """Rate of the transition to the command [m/s^2 or rad/s^2]; 0: immediate."""


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
        check(_unmeasurable(self))


def _unmeasurable(settings: WebotsSettings) -> list[tuple[str, str]]:
    """Faults: no segments, and segments shorter than `measured_s`."""
    least_s = settings.measured_s
    if not settings.segments:
        return [("segments", "is empty, allowed is one or more")]
    return [
        (f"segments[{place}].seconds", f"is {each.seconds:g}, allowed is 'measured_s' ({least_s:g}) or more")
        for place, each in enumerate(settings.segments)
        if each.seconds < least_s
    ]
