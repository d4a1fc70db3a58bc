"""Check the frame rate of a person's clip by gravity and gait. Settings of the catalogue.

Gravity: in flight a body accelerates downward with 9.81 m/s². Gait: in walking, the ratio of step length to step rate
is about 6.5 mm per step/min (Sekiya and Nagasaki 1998), and runners take about 170 steps/min at any speed. Gravity is
more precise and is preferred.

Steps and flight phases are detected in units of frames, independent of the rate. A foot in stance is at rest in the
world, regardless of floor and rate. If neither foot is at rest, the body is in free fall: it follows a parabola whose
curvature in metres per frame² gives the duration of a frame. The trunk represents the body: over correct recordings of
four sources its fall is 7.4 to 10.8 m/s²; that of a centre of mass from joint positions scatters more.
"""

import functools
import itertools
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import minimum_filter1d
from scipy.signal import find_peaks

from pipeline import rotation, time_series
from pipeline.clips.human_clip import FEET, HumanClip
from pipeline.files.ranges import COUNT, NOT_NEGATIVE, PART, RATE_HZ, SHARE, Keys, Pattern, Range
from pipeline.physics import GRAVITY
from pipeline.quality.planar_motion import facing_of, leg_length

LEAST_SPREAD = 0.15
"""Least change of the distance between the feet along the facing from step to step, as a share of the leg length."""
FORWARD_SHARE = 0.75
"""Least share of a step's displacement along the facing for a forward step."""
STRAIGHT = np.deg2rad(20.0)
"""Largest change of direction from the previous step for a straight step [rad]."""
STILL_SHARE = 0.25
"""Speed of ankle or ball, as a share of the body's speed, below which a foot is in stance or close to it."""
CLEARANCE = 0.01
"""Least height of both feet over their lowest point in a stride for a flight, as a share of the leg length."""
SHORTEST_FRAMES = 4
"""Least number of frames for an estimate of the curvature."""


class Steps(NamedTuple):
    """Forward steps, in temporal order."""

    frames: Float[np.ndarray, " n"]
    """Duration of each step [frames]."""
    length: Float[np.ndarray, " n"]
    """Displacement of the pelvis in each step [m]."""


@dataclass(frozen=True, kw_only=True)
class Flights:
    """Flight phases [start, stop) of a clip."""

    phases: tuple[tuple[int, int], ...]
    fall: Float[np.ndarray, " n"]
    """Downward acceleration of the trunk in each flight [m/frame²]."""

    @property
    def frames(self) -> Float[np.ndarray, " n"]:
        """Duration of each flight [frames]."""
        return np.array([stop - start for start, stop in self.phases], dtype=float)


@dataclass(frozen=True, kw_only=True)
class Person:
    """A person's clip with cached quantities for the detection of steps and flights."""

    clip: HumanClip

    @functools.cached_property
    def leg_length(self) -> float:
        return leg_length(self.clip)

    @functools.cached_property
    def facing(self) -> np.ndarray:
        return facing_of(self.clip)

    @functools.cached_property
    def step_events(self) -> Int[np.ndarray, " n"]:
        """Frames at which one ankle is furthest in front of the other, alternating left and right."""
        clip = self.clip
        lead = np.sum((clip.pos("left_ankle") - clip.pos("right_ankle"))[:, :2] * self.facing, axis=1)
        index = np.flatnonzero(np.isfinite(lead))
        if len(index) < 3:
            return np.zeros(0, dtype=int)
        prominence = LEAST_SPREAD * self.leg_length
        left = [(int(frame), True) for frame in index[find_peaks(lead[index], prominence=prominence)[0]]]
        right = [(int(frame), False) for frame in index[find_peaks(-lead[index], prominence=prominence)[0]]]
        events = []
        for _, same in itertools.groupby(sorted(left + right), key=lambda event: event[1]):
            frames = [frame for frame, _ in same]
            events.append((frames[0] + frames[-1]) // 2)
        return np.array(events, dtype=int)

    @functools.cached_property
    def step_rate(self) -> float | None:
        """Median number of steps per frame, in any direction; None with fewer than two steps."""
        events = self.step_events
        return None if len(events) < 3 else 1.0 / float(np.median(np.diff(events)))

    @functools.cached_property
    def flights(self) -> Flights:
        """Flight phases of running and jumping; none without steps or with missing positions."""
        clip = self.clip
        if self.step_rate is None:
            return Flights(phases=(), fall=np.zeros(0))
        height = 0.5 * (clip.pos("pelvis") + clip.pos("chest"))[:, 2]
        airborne = _airborne(clip, 2 * int(2.0 / self.step_rate / 2.0) + 1, self.leg_length) & np.isfinite(height)
        phases = tuple(
            (start, stop)
            for start, stop in time_series.runs(airborne)
            if stop - start >= SHORTEST_FRAMES and start > 0 and stop < clip.frame_count
        )
        return Flights(phases=phases, fall=np.array([_fall(height[start:stop]) for start, stop in phases]))


def forward_steps(person: Person) -> Steps:
    """Straight forward steps, each between two frames with the largest distance between the ankles (double support).

    Frames with missing positions are left out; a step across them is not counted.
    """
    pelvis, facing = person.clip.pos("pelvis")[:, :2], person.facing
    known = np.asarray(np.isfinite(np.concatenate([pelvis, facing], axis=1)).all(axis=1))
    frames, length, before = [], [], None
    for first, last in itertools.pairwise(person.step_events):
        way = pelvis[last] - pelvis[first]
        direction, before = before, way
        if direction is None or not np.all(known[first : last + 1]):
            continue
        along = np.dot(way, rotation.normalize(facing[first : last + 1].mean(axis=0)))
        if along > FORWARD_SHARE * np.linalg.norm(way) and _angle(direction, way) < STRAIGHT:
            frames.append(last - first)
            length.append(np.linalg.norm(way))
    return Steps(frames=np.array(frames, dtype=float), length=np.array(length))


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(np.arctan2(a[0] * b[1] - a[1] * b[0], np.dot(a, b))))


def _airborne(clip: HumanClip, stride: int, leg: float) -> Bool[np.ndarray, " t"]:
    """Mask (t,) of frames without a foot in stance, while the body travels at least a leg length per stride."""
    points = np.stack([clip.pos(f"{side}_{part}") for side in FEET for part in ("ankle", "toe")], axis=1)
    slowest = np.linalg.norm(time_series.derivative(points, 1.0), axis=2).min(axis=1)
    travel = time_series.derivative(_filled_mean(clip.pos("pelvis")[:, :2], stride), 1.0)
    body_speed = np.linalg.norm(travel, axis=1)
    heights = points[:, :, 2].copy()
    heights[:, 0::2] -= np.nanpercentile(heights[:, 0::2], 5.0) - np.nanpercentile(heights[:, 1::2], 5.0)
    lowest = heights.min(axis=1)
    lowest = np.where(np.isfinite(lowest), lowest, np.nanmin(lowest))
    clear = lowest - minimum_filter1d(lowest, stride) > CLEARANCE * leg
    return clear & (slowest > STILL_SHARE * body_speed) & (body_speed * stride > leg)


def _filled_mean(values: np.ndarray, width: int) -> np.ndarray:
    """Moving mean (t, 2) of positions; missing ones are filled with the last known position."""
    known = np.isfinite(values).all(axis=1)
    last = np.maximum.accumulate(np.where(known, np.arange(len(values)), 0))
    return time_series.moving_mean(np.nan_to_num(values)[last], width)


def _fall(height: Float[np.ndarray, " n"]) -> float:
    """Downward acceleration [m/frame²] of the least-squares parabola."""
    frames = np.arange(len(height)) - (len(height) - 1) / 2.0
    return float(-2.0 * np.polyfit(frames, height, 2)[0])


@dataclass(frozen=True, kw_only=True)
class TimeBaseSettings:
    """Thresholds for a wrong frame rate, and possible replacements."""

    standard_rates_hz: Annotated[tuple[float, ...], RATE_HZ]
    """Rates at which motion is recorded or exported [Hz]."""
    gravity_ratio: Annotated[float, Range(1.0, 10.0, open_low=True)]
    """True rate over the file's rate (or the reverse) from which flights contradict the file."""
    gait_ratio: Annotated[float, Range(1.0, 10.0, open_low=True)]
    """`gravity_ratio` for the check by gait, used without flights."""
    certain_gait_ratio: Annotated[float, Range(1.0, 10.0, open_low=True)]
    """Ratio from which steps alone prove a wrong rate, beyond the differences between people."""
    fewest_flights: Annotated[int, COUNT]
    """Least number of flight phases for a check by gravity."""
    flight_spread: Annotated[float, PART]
    """Largest median deviation of the phases' fall from their median, as a share of it."""
    gravity_tolerance: Annotated[float, PART]
    """Largest relative difference of a standard rate from the rate by gravity that it explains."""
    gait_tolerance: Annotated[float, PART]
    """Largest relative difference of a standard rate from the rate by gait that it explains."""
    same_rate: Annotated[float, SHARE]
    """Relative difference below which standard rates (24 and 25 Hz) are not distinguished: the nearest is used."""
    usual_rates_hz: Annotated[dict[str, tuple[float, ...]], Keys(keys=Pattern(), values=RATE_HZ)]
    """Pattern of a skeleton's name -> rates at which its sources record [Hz]; they decide between several standard
    rates that explain the motion."""
    usual_ratio: Annotated[float, Range(1.0, 10.0, open_low=True)]
    """Ratio of the file's rate to a usual one from which the usual one replaces it, if it fits the evidence better."""
    fewest_steps: Annotated[int, COUNT]
    """Least number of straight forward steps for a check by gait."""
    shortest_step: Annotated[float, NOT_NEGATIVE]
    """Least step length as a share of the leg length; shuffling has no constant ratio."""


@dataclass(frozen=True, kw_only=True)
class CatalogSettings:
    """All settings of the catalogue."""

    velocity_s: Annotated[float, Range(0.01, 5.0)]
    """Width of the moving mean on the root's velocity [s]."""
    facing_s: Annotated[float, Range(0.01, 5.0)]
    """Width of the moving mean on the facing [s]."""
    bridge_s: Annotated[float, Range(0.0, 5.0)]
    """Longest gap of the recording that is interpolated before anything is measured [s]."""
    least_recorded_share: Annotated[float, SHARE]
    """Least share of recorded frames among those with known motion after the interpolation of gaps."""
    repeated_share: Annotated[float, PART]
    """Least share of all steps that are in the pattern of repeated frames."""
    time_base: TimeBaseSettings


WALK_RATIO_M_MIN = 0.0065
"""Step length over cadence in walking [m/(steps/min)]."""
RUNNING_CADENCE = 170.0
"""Cadence of running, nearly independent of speed [steps/min] (Nilsson and Thorstensson 1987)."""


@dataclass(frozen=True, kw_only=True)
class Clock:
    """One kind of evidence for the rate."""

    fps: float
    """The rate according to this evidence [Hz]."""
    text: str
    """Description of the evidence at the file's rate."""
    tolerance: float
    """Largest relative difference of the true rate from `fps`."""
    limit: float
    """Ratio of both rates from which the evidence contradicts the file."""


@dataclass(frozen=True, kw_only=True)
class TimeBase:
    """Evaluation of a clip's rate."""

    gravity: Clock | None = None
    """Evidence by gravity; None: too few flights, or inconsistent ones."""
    gait: Clock | None = None
    """Evidence by gait; None: too few straight forward steps."""
    ratio: float | None = None
    """Rate of the decisive evidence relative to the clip's rate; None without evidence."""
    limit: float | None = None
    """Ratio from which that evidence contradicts the clip's rate."""
    contradicted: bool = False
    """Whether the evidence contradicts the clip's rate."""
    certain: bool = False
    """Whether the contradiction exceeds the differences between people."""
    fps: float | None = None
    """The only standard rate that explains a contradiction [Hz]; None if there is none or several."""
    candidates: tuple[float, ...] = ()
    """All standard rates that explain a contradiction [Hz]."""


def judge(person: Person, skeleton: str, settings: TimeBaseSettings) -> TimeBase:
    """Compare a clip's rate with gravity and gait. `skeleton`: name of its map, which depends on who recorded it."""
    fps = person.clip.fps
    gravity = _by_gravity(person.flights, fps, settings)
    gait = _by_gait(forward_steps(person), person.leg_length, fps, settings)
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
    """Rate from the median acceleration over the flights, weighted by duration, as long flights are more precise."""
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
    """Median over the steps of the rate at which each has the cadence expected for its length."""
    long = steps.length >= settings.shortest_step * leg
    if long.sum() < settings.fewest_steps:
        return None
    length, frames = steps.length[long], steps.frames[long]
    expected = np.minimum(length / WALK_RATIO_M_MIN, RUNNING_CADENCE)
    cadence = 60.0 * fps / float(np.median(frames))
    text = (
        f"{cadence:.0f} steps a minute of {np.median(length):.2f} m are taken, where people take "
        f"about {np.median(expected):.0f}"
    )
    rate = float(np.median(expected * frames / 60.0))
    return Clock(fps=rate, text=text, tolerance=settings.gait_tolerance, limit=settings.gait_ratio)


def _candidates(clock: Clock, settings: TimeBaseSettings) -> tuple[float, ...]:
    """Standard rates within the clock's tolerance, sorted by distance; of nearly equal ones only the nearest."""
    near = [rate for rate in settings.standard_rates_hz if _apart(rate, clock.fps) <= 1.0 + clock.tolerance]
    chosen: list[float] = []
    for rate in sorted(near, key=lambda rate: (_apart(rate, clock.fps), rate)):
        if all(_apart(rate, other) > 1.0 + settings.same_rate for other in chosen):
            chosen.append(float(rate))
    return tuple(chosen)


def _instead(clock: Clock, fps: float, usual: frozenset[float], settings: TimeBaseSettings) -> float | None:
    """The usual rate that explains the evidence, if the file's rate is far from it and explains it worse."""
    if not usual:
        return None
    best = min(usual, key=lambda rate: _apart(rate, clock.fps))
    explains = _apart(best, clock.fps) <= 1.0 + clock.tolerance and _apart(best, clock.fps) < _apart(fps, clock.fps)
    return best if explains and _apart(best, fps) >= settings.usual_ratio else None


def _only_one(candidates: tuple[float, ...], usual: frozenset[float]) -> float | None:
    """The only candidate, or the only one that is usual for the skeleton."""
    left = candidates if len(candidates) == 1 else tuple(rate for rate in candidates if rate in usual)
    return left[0] if len(left) == 1 else None
