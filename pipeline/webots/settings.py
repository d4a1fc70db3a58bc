"""Settings of `data/webots.yaml`: commands and world. The thresholds are in `robots/<robot>/validation.yaml`."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.files.ranges import NOT_NEGATIVE, POSITIVE, Range, check


@dataclass(frozen=True, kw_only=True)
class WalkSegment:
    """A segment with one commanded velocity."""

    name: str
    seconds: float
    command: tuple[float, float, float]
    """Forward and lateral [m/s], yaw rate [rad/s]."""
    slew: float = 1.0
    """Rate of the transition to the command [m/s^2 or rad/s^2]; 0: immediate."""

    def __post_init__(self) -> None:
        check(self, slew=NOT_NEGATIVE, seconds=POSITIVE)


@dataclass(frozen=True, kw_only=True)
class Allowed:
    """Largest deviation from a segment's command."""

    velocity_error_m_s: float
    yaw_rate_error_rad_s: float


@dataclass(frozen=True, kw_only=True)
class WebotsSettings:
    """The whole file."""

    timestep_ms: float
    friction: float
    measured_s: float
    """Length of the end of each segment over which means are taken [s]."""
    limit_s: float
    """Limit of wall-clock time [s]."""
    segments: tuple[WalkSegment, ...]

    def __post_init__(self) -> None:
        allowed = dict.fromkeys(("friction", "measured_s", "limit_s"), POSITIVE)
        check(self, _unmeasurable(self), timestep_ms=Range(1.0, 5.0), **allowed)


def _unmeasurable(settings: WebotsSettings) -> list[tuple[str, str]]:
    """Faults: no segments, and segments shorter than `measured_s`."""
    segments, least_s = getattr(settings, "segments", None), getattr(settings, "measured_s", None)
    if segments is None or least_s is None:
        return []
    if not segments:
        return [("segments", "is empty, allowed is one or more")]
    return [
        (f"segments[{place}].seconds", f"is {each.seconds:g}, allowed is 'measured_s' ({least_s:g}) or more")
        for place, each in enumerate(segments)
        if each is not None and each.seconds < least_s
    ]
