"""Stretches in which the person glides: the foot that carries the body slides over the ground.

At every moment of a walk some point of the feet is planted, and in a run one is in most of a stride. The slowest of
the points that are near the ground therefore stands still again and again; where it does not for most of a second,
the feet slide, whatever else they do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.ndimage import median_filter, percentile_filter

from pipeline import time_series
from pipeline.repair.contacts import FootPoints
from pipeline.repair.settings import ContactSettings

WINDOW_S, STILL_PERCENTILE = 0.8, 20.0
"""The slowest fifth of a window this long tells whether a foot stands in it [s]."""
EDGE_S, CLOSED_S = 0.1, 0.15
"""Edges are sought in a median this long; frames between that seem to stand are taken along up to this long [s]."""
SWINGING = 2.0
"""What is so many times as fast as the sliding feet swings."""
FAST = 9.0
"""Stands for a frame in which no point is near the ground [m/s]."""


@dataclass(frozen=True, kw_only=True)
class Skating:
    """Frames [start, stop) in which the feet slide."""

    start: int
    stop: int
    speed_m_s: float


def find_skating(feet: tuple[FootPoints, FootPoints], fps: float, settings: ContactSettings) -> list[Skating]:
    """Stretches of a clip in which no foot stands still although they are on the ground."""
    speed = support_speed(feet, settings)
    width = min(2 * round(WINDOW_S * fps / 2.0) + 1, len(speed))
    usual = percentile_filter(speed, STILL_PERCENTILE, size=width, mode="nearest")
    core = (usual > settings.skate_limit_m_s) & (usual < FAST)
    if not core.any():
        return []
    result: list[Skating] = []
    for start, stop in time_series.runs(core):
        inside = speed[start:stop]
        sliding = float(np.median(inside[inside < FAST]))
        sliding = min(sliding, SWINGING * float(usual[start:stop].max()))
        smooth = median_filter(
            _known(speed, SWINGING * sliding), size=2 * round(EDGE_S * fps / 2.0) + 1, mode="nearest"
        )
        moving = _closed(smooth > sliding / 2.0, round(CLOSED_S * fps))
        around = [(low, high) for low, high in time_series.runs(moving) if low < stop and high > start]
        low = min((low for low, _ in around), default=start)
        high = max((high for _, high in around), default=stop)
        if result and low < result[-1].stop:
            low = result[-1].start
            result.pop()
        result.append(Skating(start=low, stop=high, speed_m_s=sliding))
    return result


def support_speed(feet: tuple[FootPoints, FootPoints], settings: ContactSettings) -> Float[np.ndarray, " t"]:
    """Horizontal speed of the slowest point near the ground [m/s]; `FAST` where there is none."""
    height = np.concatenate([foot.height for foot in feet], axis=1)
    horizontal = np.concatenate([foot.horizontal for foot in feet], axis=1)
    return np.where(height < settings.height, np.minimum(horizontal, FAST), FAST).min(axis=1)


def _known(speed: Float[np.ndarray, " t"], fastest: float) -> Float[np.ndarray, " t"]:
    """Speeds where a foot stands; elsewhere the smaller one of the stances before and after."""
    stands = np.flatnonzero(speed <= fastest)
    if not len(stands):
        return speed
    frames = np.searchsorted(stands, np.arange(len(speed)))
    after, before = stands[np.minimum(frames, len(stands) - 1)], stands[np.maximum(frames - 1, 0)]
    return np.where(speed <= fastest, speed, np.minimum(speed[before], speed[after]))


def _closed(mask: np.ndarray, shortest: int) -> np.ndarray:
    """A mask without inner gaps shorter than `shortest` frames."""
    result = mask.copy()
    for start, stop in time_series.runs(~mask):
        if stop - start < shortest and start > 0 and stop < len(mask):
            result[start:stop] = True
    return result
