"""The height of the ground under a person: where the balls of the feet are when they stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pipeline import time_series
from pipeline.clips.human_clip import FEET, HumanClip
from pipeline.repair.settings import FloorSettings

FEWEST_FRAMES = 5
FALLBACK_PERCENTILE = 5.0
"""Where no foot ever stands (a clip of a leap) the ground is taken from the lowest toes."""


@dataclass(frozen=True, kw_only=True)
class Floor:
    """What is known of the ground; heights in the clip's world [m]."""

    height: float
    """The ground: the stance height of the balls of the feet less the joint's height over the sole."""
    drift: float
    """Change of the stance height from the clip's first third to its last; 0 where too few frames stand."""
    stance_frames: int
    """Foot-frames the height was taken from."""


def find_floor(clip: HumanClip, settings: FloorSettings, sound: Bool[np.ndarray, " t"]) -> Floor:
    """The ground of a clip from its `sound` frames.

    Of the heights of slow toes the densest band is taken (as PHUMA does) and its median.
    """
    heights, frames = [], []
    for side in FEET:
        toe_pos_w = clip.pos(f"{side}_toe")
        speed = np.linalg.norm(time_series.derivative(toe_pos_w, clip.fps), axis=1)
        standing = np.flatnonzero((speed < settings.slow_m_s) & sound)
        heights.append(toe_pos_w[standing, 2])
        frames.append(standing)
    height, when = np.concatenate(heights), np.concatenate(frames)
    if len(height) < FEWEST_FRAMES:
        toes = np.concatenate([clip.pos(f"{side}_toe")[sound, 2] for side in FEET])
        lowest = float(np.percentile(toes, FALLBACK_PERCENTILE)) if len(toes) else settings.ball_height
        return Floor(height=lowest - settings.ball_height, drift=0.0, stance_frames=0)
    inside = np.abs(height - densest(height, settings.band)) <= settings.band / 2.0
    middle = float(np.median(height[inside]))
    return Floor(
        height=middle - settings.ball_height,
        drift=_drift(height, when, middle, clip.frame_count, settings),
        stance_frames=int(inside.sum()),
    )


def densest(values: Float[np.ndarray, " n"], width: float) -> float:
    """Centre of the interval of `width` that holds the most of `values`; of equals the lowest, then the tightest."""
    ordered = np.sort(values)
    last = np.searchsorted(ordered, ordered + width, side="right")
    count = last - np.arange(len(ordered))
    spread = ordered[last - 1] - ordered
    best = int(np.lexsort((spread, ordered, -count))[0])
    return float(ordered[best] + ordered[last[best] - 1]) / 2.0


def _drift(height: np.ndarray, when: np.ndarray, middle: float, frame_count: int, settings: FloorSettings) -> float:
    """Difference of the stance heights of the clip's last third and first third, near the ground [m]."""
    near = np.abs(height - middle) < 3.0 * settings.band
    first = height[near & (when < frame_count / 3)]
    last = height[near & (when >= frame_count * 2 / 3)]
    if min(len(first), len(last)) < FEWEST_FRAMES:
        return 0.0
    return densest(last, settings.band) - densest(first, settings.band)
