"""Steps and flight phases of a person who walks or runs forward, in frames; nothing here needs the clip's rate.

So the results can be used to check the rate. A foot that stands is still in the world, whatever the floor looks like
and whatever the rate is. Where neither foot is, the body is in free fall: it follows a parabola whose curvature in
metres per frame² gives the duration of a frame, because gravity is known. The trunk represents the body: over correct
recordings of four sources its fall is 7.4 to 10.8 m/s², that of a centre of mass from joint positions scatters more.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import minimum_filter1d
from scipy.signal import find_peaks

from pipeline import rotation, time_series
from pipeline.clips.human_clip import FEET, HumanClip
from pipeline.quality.planar_motion import facing_of

LEAST_SPREAD = 0.15
"""Between two steps the feet's lead over each other swings by at least this share of the leg's length."""
AHEAD = 0.75
"""A step goes ahead when this share of its way is along the facing."""
STRAIGHT = np.deg2rad(20.0)
"""A step is straight when the way turns less from the step before it [rad]."""
STILL_SHARE = 0.25
"""A foot of which ankle or ball moves slower than this share of the body's speed stands, or is about to."""
CLEARANCE = 0.01
"""Both feet are over their lowest point of a stride by this share of the leg's length."""
SHORTEST_FRAMES = 4
"""Fewer frames tell no curvature."""


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Steps ahead, in the order of time."""

    frames: Float[np.ndarray, " n"]
    """Duration of each step [frames]."""
    length: Float[np.ndarray, " n"]
    """Way of the pelvis in each step [m]."""


@dataclass(frozen=True, kw_only=True)
class Flights:
    """Flight phases [start, stop) of a clip."""

    phases: tuple[tuple[int, int], ...]
    fall: Float[np.ndarray, " n"]
    """Downward acceleration of the trunk in each [m/frame²]."""

    @property
    def frames(self) -> Float[np.ndarray, " n"]:
        """Duration of each [frames]."""
        return np.array([stop - start for start, stop in self.phases], dtype=float)


@dataclass(frozen=True, kw_only=True)
class Person:
    """A person's clip with what steps and flights are found from; each quantity is computed once."""

    clip: HumanClip

    @functools.cached_property
    def leg_length(self) -> float:
        """Thigh plus shank [m], median over frames, mean of both sides; NaN where nothing was recorded."""
        sides = []
        for side in FEET:
            hip, knee, ankle = (self.clip.pos(f"{side}_{part}") for part in ("hip", "knee", "ankle"))
            length = rotation.length(knee - hip) + rotation.length(ankle - knee)
            length = length[np.isfinite(length)]
            sides.append(float(np.median(length)) if len(length) else float("nan"))
        return sum(sides) / len(sides)

    @functools.cached_property
    def facing(self) -> np.ndarray:
        """Horizontal normal of the line between the hips (t, 2), unit."""
        return facing_of(self.clip)

    @functools.cached_property
    def step_events(self) -> Int[np.ndarray, " n"]:
        """Frames at which one ankle leads the other most, left and right in turns."""
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
        """Median number of steps a frame, in any direction; None where fewer than two steps are seen."""
        events = self.step_events
        return None if len(events) < 3 else 1.0 / float(np.median(np.diff(events)))

    @functools.cached_property
    def flights(self) -> Flights:
        """Flight phases of running and jumping; none where no steps are seen or positions are missing."""
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


def steps_ahead(person: Person) -> Steps:
    """The straight steps ahead, each between two moments at which one ankle leads most: double supports of walking.

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
        ahead = np.dot(way, rotation.normalize(facing[first : last + 1].mean(axis=0)))
        if ahead > AHEAD * np.linalg.norm(way) and _angle(direction, way) < STRAIGHT:
            frames.append(last - first)
            length.append(np.linalg.norm(way))
    return Steps(frames=np.array(frames, dtype=float), length=np.array(length))


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(np.arctan2(a[0] * b[1] - a[1] * b[0], np.dot(a, b))))


def _airborne(clip: HumanClip, stride: int, leg: float) -> Bool[np.ndarray, " t"]:
    """Frames (t,) in which no foot stands, while the body travels at least a leg's length in a stride."""
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
    """Moving mean (t, 2) of positions; missing ones keep the last known place."""
    known = np.isfinite(values).all(axis=1)
    last = np.maximum.accumulate(np.where(known, np.arange(len(values)), 0))
    return time_series.moving_mean(np.nan_to_num(values)[last], width)


def _fall(height: Float[np.ndarray, " n"]) -> float:
    """Downward acceleration [m/frame²] of the least-squares parabola."""
    frames = np.arange(len(height)) - (len(height) - 1) / 2.0
    return float(-2.0 * np.polyfit(frames, height, 2)[0])
