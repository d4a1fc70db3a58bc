"""Steps of a person who walks or runs ahead, in frames: how long they take and how far they go.

Nothing here needs the clip's rate, so that it can be used to judge it.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.signal import find_peaks

from pipeline import rotation
from pipeline.clips.human_clip import FEET, HumanClip

LEAST_SPREAD = 0.15
"""Between two steps the feet's lead over each other swings by at least this share of the leg's length."""
AHEAD = 0.75
"""A step goes ahead when this share of its way is along the facing."""
STRAIGHT = np.deg2rad(20.0)
"""A step is straight when the way turns less from the step before it [rad]."""


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Steps ahead, in the order of time."""

    frames: Float[np.ndarray, " n"]
    """Duration of each step [frames]."""
    length: Float[np.ndarray, " n"]
    """Way of the pelvis in each step [m]."""


@dataclass(frozen=True, kw_only=True)
class Legs:
    """A person's clip as the steps' clock looks at it; what is needed several times is worked out once."""

    clip: HumanClip

    @functools.cached_property
    def leg_length(self) -> float:
        """Thigh plus shank [m], median over frames, mean of both sides; NaN where nothing was recorded."""
        return leg_length(self.clip)

    @functools.cached_property
    def facing(self) -> np.ndarray:
        """Horizontal normal of the line between the hips (t, 2), unit."""
        left = self.clip.pos("left_hip") - self.clip.pos("right_hip")
        return rotation.normalize(np.stack([left[:, 1], -left[:, 0]], axis=1))

    @functools.cached_property
    def step_events(self) -> Int[np.ndarray, " n"]:
        """Frames at which one ankle leads the other most, left and right in turns."""
        return _step_events(self)

    @functools.cached_property
    def step_rate(self) -> float | None:
        """Median number of steps a frame, in any direction; None where fewer than two steps are seen."""
        events = self.step_events
        return None if len(events) < 3 else 1.0 / float(np.median(np.diff(events)))


def leg_length(clip: HumanClip) -> float:
    """Thigh plus shank [m], median over frames, mean of both sides; NaN where nothing was recorded."""
    sides = []
    for side in FEET:
        hip, knee, ankle = (clip.pos(f"{side}_{part}") for part in ("hip", "knee", "ankle"))
        length = rotation.length(knee - hip) + rotation.length(ankle - knee)
        length = length[np.isfinite(length)]
        sides.append(float(np.median(length)) if len(length) else float("nan"))
    return sum(sides) / len(sides)


def steps_ahead(legs: Legs) -> Steps:
    """The straight steps ahead, each between two moments at which one ankle leads most: double supports of walking.

    Frames with missing positions are left out; a step across them is not counted.
    """
    events = legs.step_events
    pelvis, facing = legs.clip.pos("pelvis")[:, :2], legs.facing
    known = np.asarray(np.isfinite(np.concatenate([pelvis, facing], axis=1)).all(axis=1))
    frames, length, before = [], [], None
    for first, last in itertools.pairwise(events):
        way = pelvis[last] - pelvis[first]
        direction, before = before, way
        if direction is None or not np.all(known[first : last + 1]):
            continue
        ahead = np.dot(way, rotation.normalize(facing[first : last + 1].mean(axis=0)))
        if ahead > AHEAD * np.linalg.norm(way) and _angle(direction, way) < STRAIGHT:
            frames.append(last - first)
            length.append(np.linalg.norm(way))
    return Steps(frames=np.array(frames, dtype=float), length=np.array(length))


def _step_events(legs: Legs) -> Int[np.ndarray, " n"]:
    clip = legs.clip
    lead = np.sum((clip.pos("left_ankle") - clip.pos("right_ankle"))[:, :2] * legs.facing, axis=1)
    index = np.flatnonzero(np.isfinite(lead))
    if len(index) < 3:
        return np.zeros(0, dtype=int)
    prominence = LEAST_SPREAD * legs.leg_length
    left = [(int(frame), True) for frame in index[find_peaks(lead[index], prominence=prominence)[0]]]
    right = [(int(frame), False) for frame in index[find_peaks(-lead[index], prominence=prominence)[0]]]
    events = []
    for _, same in itertools.groupby(sorted(left + right), key=lambda event: event[1]):
        frames = [frame for frame, _ in same]
        events.append((frames[0] + frames[-1]) // 2)
    return np.array(events, dtype=int)


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(np.arctan2(a[0] * b[1] - a[1] * b[0], np.dot(a, b))))
