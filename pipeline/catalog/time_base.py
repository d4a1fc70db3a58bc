"""Is a person's clip at the rate that its file states? Gravity and gait show it. Settings of the catalogue.

Gravity: in flight a body falls with 9.81 m/s², whatever it does. Gait: the length of people's steps over their
rate is a constant of about 6.5 mm per step a minute when they walk (Sekiya and Nagasaki 1998), and runners take
about 170 steps a minute whatever their speed. Gravity is the more precise clock and is used where both can be read.
"""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Annotated

import numpy as np

from pipeline import time_series
from pipeline.catalog.gait import Flights, Person, Steps, steps_ahead
from pipeline.files.ranges import COUNT, NOT_NEGATIVE, PART, RATE_HZ, SHARE, Keys, Pattern, Range
from pipeline.physics import GRAVITY


@dataclass(frozen=True, kw_only=True)
class TimeBaseSettings:
    """When a frame rate is wrong, and what may stand in its place."""

    standard_rates_hz: Annotated[tuple[float, ...], RATE_HZ]
    """Rates at which motion is recorded or exported [Hz]."""
    gravity_ratio: Annotated[float, Range(1.0, 10.0, open_low=True)]
    """True rate over the file's rate (or the reverse) from which flights contradict the file."""
    gait_ratio: Annotated[float, Range(1.0, 10.0, open_low=True)]
    """The same for steps, where there are no flights."""
    certain_gait_ratio: Annotated[float, Range(1.0, 10.0, open_low=True)]
    """From here on steps alone are enough to call a rate wrong: people differ, gravity does not."""
    fewest_flights: Annotated[int, COUNT]
    """Flight phases that a check by gravity needs."""
    flight_spread: Annotated[float, PART]
    """Largest median deviation of the phases' fall from their median, as a share of it."""
    gravity_tolerance: Annotated[float, PART]
    """A standard rate explains the flights when it is within this share of what they tell."""
    gait_tolerance: Annotated[float, PART]
    """The same for the steps."""
    same_rate: Annotated[float, SHARE]
    """Standard rates this close to each other (24 and 25 Hz) are not distinguished: the nearest is taken."""
    usual_rates_hz: Annotated[dict[str, tuple[float, ...]], Keys(keys=Pattern(), values=RATE_HZ)]
    """Pattern of a skeleton's name -> rates at which its sources record [Hz]; they decide between several standard
    rates that explain the motion."""
    usual_ratio: Annotated[float, Range(1.0, 10.0, open_low=True)]
    """A file's rate this far from a usual one gives way to it when gravity or gait are nearer to that one."""
    fewest_steps: Annotated[int, COUNT]
    """Straight steps forward that a check by gait needs."""
    shortest_step: Annotated[float, NOT_NEGATIVE]
    """Steps shorter than this share of the leg's length do not count: shuffling follows no rule."""


@dataclass(frozen=True, kw_only=True)
class CatalogSettings:
    """All of the catalogue."""

    velocity_s: Annotated[float, Range(0.01, 5.0)]
    """Width of the moving mean on the root's velocity [s]."""
    facing_s: Annotated[float, Range(0.01, 5.0)]
    """Width of the moving mean on the facing [s]."""
    bridge_s: Annotated[float, Range(0.0, 5.0)]
    """Longest gap of the recording that is interpolated before anything is measured [s]."""
    least_recorded_share: Annotated[float, SHARE]
    """Of the frames whose motion is known once gaps are bridged at least this share has to be recorded."""
    repeated_share: Annotated[float, PART]
    """Share of all moves from frame to frame that are in the pattern where frames are stored several times."""
    time_base: TimeBaseSettings


WALK_RATIO_M_MIN = 0.0065
"""Step length over cadence in walking [m/(steps/min)]."""
RUNNING_CADENCE = 170.0
"""Steps a minute that runners don't pass by much (Nilsson and Thorstensson 1987)."""


@dataclass(frozen=True, kw_only=True)
class Clock:
    """One kind of evidence for the rate."""

    fps: float
    """The rate it tells [Hz]."""
    text: str
    """What was seen at the file's rate, for people."""
    tolerance: float
    """Share by which the true rate may differ from `fps`."""
    limit: float
    """Ratio of the two rates from which it contradicts the file."""


@dataclass(frozen=True, kw_only=True)
class TimeBase:
    """Evaluation of a clip's rate."""

    gravity: Clock | None = None
    """None: too few flights, or flights that disagree."""
    gait: Clock | None = None
    """None: too few straight steps ahead."""
    ratio: float | None = None
    """Rate that the decisive evidence tells over the clip's rate; None without evidence."""
    limit: float | None = None
    """Ratio from which that evidence contradicts the clip's rate."""
    contradicted: bool = False
    """The evidence contradicts the clip's rate."""
    certain: bool = False
    """It does so by more than people differ."""
    fps: float | None = None
    """The one standard rate that explains a contradiction [Hz]; None where there is none or more than one."""
    candidates: tuple[float, ...] = ()
    """All standard rates that explain a contradiction [Hz]."""


def judge(person: Person, skeleton: str, settings: TimeBaseSettings) -> TimeBase:
    """Compare a clip's rate with gravity and gait. `skeleton`: name of its map, which depends on who recorded it."""
    fps = person.clip.fps
    gravity = _by_gravity(person.flights, fps, settings)
    gait = _by_gait(steps_ahead(person), person.leg_length, fps, settings)
    decisive = gravity or gait
    if decisive is None:
        return TimeBase()
    size, limit = _apart(decisive.fps, fps), decisive.limit
    contradicted = size >= limit
    agree = gravity is None or gait is None or _apart(gravity.fps, gait.fps) < settings.certain_gait_ratio
    certain = contradicted and (size >= settings.certain_gait_ratio if gravity is None else agree)
    patterns = [pattern for pattern in settings.usual_rates_hz if fnmatchcase(skeleton, pattern)]
    usual = frozenset(rate for pattern in patterns for rate in settings.usual_rates_hz[pattern])
    instead = _instead(decisive, fps, usual, settings)
    if instead is not None:
        contradicted, certain, limit = True, True, min(limit, settings.usual_ratio)
    candidates = _candidates(decisive, settings) if contradicted else ()
    return TimeBase(
        gravity=gravity,
        gait=gait,
        ratio=decisive.fps / fps,
        limit=limit,
        contradicted=contradicted,
        certain=certain,
        fps=instead or _only_one(candidates, usual),
        candidates=candidates,
    )


def _apart(a: float, b: float) -> float:
    return max(a / b, b / a)


def _by_gravity(flights: Flights, fps: float, settings: TimeBaseSettings) -> Clock | None:
    """Median fall over the flights; a flight's curvature is the surer the longer it is, so it weighs more."""
    if len(flights.fall) < settings.fewest_flights:
        return None
    fall = time_series.weighted_median(flights.fall, flights.frames**2)
    spread = time_series.weighted_median(np.abs(flights.fall - fall), flights.frames**2)
    if fall <= 0.0 or spread > settings.flight_spread * fall:
        return None
    rate = float(np.sqrt(GRAVITY / fall))
    text = f"in {len(flights.fall)} flight phases the body falls with {fall * fps**2:.2f} m/s² instead of {GRAVITY}"
    return Clock(fps=rate, text=text, tolerance=settings.gravity_tolerance, limit=settings.gravity_ratio)


def _by_gait(steps: Steps, leg: float, fps: float, settings: TimeBaseSettings) -> Clock | None:
    """Median over the steps of the rate at which each would have the cadence that its length asks for."""
    long = steps.length >= settings.shortest_step * leg
    if long.sum() < settings.fewest_steps:
        return None
    length, frames = steps.length[long], steps.frames[long]
    wanted = np.minimum(length / WALK_RATIO_M_MIN, RUNNING_CADENCE)
    cadence = 60.0 * fps / float(np.median(frames))
    text = (
        f"{cadence:.0f} steps a minute of {np.median(length):.2f} m are taken, where people take "
        f"about {np.median(wanted):.0f}"
    )
    rate = float(np.median(wanted * frames / 60.0))
    return Clock(fps=rate, text=text, tolerance=settings.gait_tolerance, limit=settings.gait_ratio)


def _candidates(clock: Clock, settings: TimeBaseSettings) -> tuple[float, ...]:
    """Standard rates within the clock's tolerance, the nearest first; of nearly equal ones only the nearest."""
    near = [rate for rate in settings.standard_rates_hz if _apart(rate, clock.fps) <= 1.0 + clock.tolerance]
    chosen: list[float] = []
    for rate in sorted(near, key=lambda rate: (_apart(rate, clock.fps), rate)):
        if all(_apart(rate, other) > 1.0 + settings.same_rate for other in chosen):
            chosen.append(float(rate))
    return tuple(chosen)


def _instead(clock: Clock, fps: float, usual: frozenset[float], settings: TimeBaseSettings) -> float | None:
    """The usual rate that explains what the clock tells, where it does so better than the file's, which is far off."""
    if not usual:
        return None
    best = min(usual, key=lambda rate: _apart(rate, clock.fps))
    explains = _apart(best, clock.fps) <= 1.0 + clock.tolerance and _apart(best, clock.fps) < _apart(fps, clock.fps)
    return best if explains and _apart(best, fps) >= settings.usual_ratio else None


def _only_one(candidates: tuple[float, ...], usual: frozenset[float]) -> float | None:
    """The only candidate, or the only one that is usual for the skeleton."""
    left = candidates if len(candidates) == 1 else tuple(rate for rate in candidates if rate in usual)
    return left[0] if len(left) == 1 else None
