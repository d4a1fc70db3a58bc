"""Shaking: stretches in which bodies are off what their neighbours in time say, frame after frame.

That a body shakes shows in a window most of whose frames are off. Where it begins and ends is a question of its own:
a bad frame disturbs the bridges of two frames on either side, by a known share, and motion misses a little, too. Of all
places where the scale of the misses may change, that is taken which explains what all bodies miss there best.
"""

import numpy as np
from jaxtyping import Bool, Float

from pipeline import time_series
from pipeline.repair.defect import Defect, spans
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.tree import FrameMask
from pipeline.repair.unsteadiness import REACH, Seen, slow_rate, turn_limits

NOISE_SPREAD, OFTEN_PERCENTILE = 3.0, 75.0
"""A body shakes where it misses by so many times what it does in a quarter of all other frames."""
FEWEST_FRAMES = 7
"""Of a window that may be shaking."""
SPILL: tuple[float, ...] = (0.12, 0.49, 0.87, 0.99)
"""Share of its full size that the miss of shaking has in the two frames before the first that shakes and in that and
the next one: white noise through the bridge's weights (-1, 4, 6, 4, -1) / 6."""
MEDIAN_SIZE, QUARTER_SIZE = 1.54, 2.03
"""Sizes of a normal vector in space that half and three quarters stay below, per standard deviation of an axis."""
CLEARLY = 3.0
"""What tells of an edge is so many times as rough inside as outside, and what shakes along is, too."""
FREEDOM = 3.0
"""Degrees of freedom of Student's distribution, whose tails let single frames of motion miss by much."""

Sizes = Float[np.ndarray, "t n"]


def find_noise(seen: Seen, fps: float, settings: DetectionSettings) -> list[Defect]:
    """Stretches in which bodies shake: most frames are off what their neighbours say (`noise`)."""
    width = max(FEWEST_FRAMES, 2 * round(settings.noise_s * fps / 2.0) + 1)
    if len(seen.pos_w) < width:
        return []
    turn, place = seen.misses
    least = turn_limits(settings)
    turn_limit = least * (settings.noise_turn / settings.angle_jump) * slow_rate(fps)
    place_limit = np.full(place.shape[1], settings.noise_place)
    place_limit[0] = settings.root_jump / 2.0
    rough = (turn > turn_limit) | (place > place_limit)
    shaking = np.zeros_like(rough)
    for index in np.flatnonzero(rough.sum(axis=0) >= settings.noise_share * width).tolist():
        usual = NOISE_SPREAD * _usual(turn[:, index], _stretches(rough[:, index], width, settings), width)
        off = (turn[:, index] > max(turn_limit[index], usual)) | (place[:, index] > place_limit[index])
        for start, stop in _stretches(off, width, settings):
            shaking[start:stop, index] = True
    if not shaking.any():
        return []
    limits = np.concatenate([turn_limit, place_limit])
    sizes = np.concatenate([turn, place], axis=1)
    for start, stop in time_series.runs(np.asarray(shaking.any(axis=1))):
        bodies = shaking[start:stop].any(axis=0)
        first, last, along = _located(sizes, limits, start, stop, width)
        shaking[start:stop] = False
        shaking[first:last, bodies | along] = True
    return spans("noise", "{names} shaking from frame to frame", shaking, pos=shaking, rot=shaking)


def _stretches(rough: FrameMask, width: int, settings: DetectionSettings) -> list[tuple[int, int]]:
    """From the first to the last rough frame of windows most of whose frames are rough."""
    if rough.sum() < settings.noise_share * width:
        return []
    result = []
    core = time_series.moving_mean(rough.astype(float), width) >= settings.noise_share - 1e-9
    for start, stop in time_series.runs(core):
        inside = start + np.flatnonzero(rough[start:stop])
        if len(inside):
            result.append((int(inside[0]), int(inside[-1]) + 1))
    return result


def _usual(size: Float[np.ndarray, " t"], stretches: list[tuple[int, int]], width: int) -> float:
    """What a body misses by in three quarters of the frames outside `stretches`; of all frames where those are few."""
    outside = np.ones(len(size), dtype=bool)
    for start, stop in stretches:
        outside[max(start - width // 2, 0) : stop + width // 2] = False
    return float(np.percentile(size[outside] if outside.mean() > 0.5 else size, OFTEN_PERCENTILE))


def _located(
    sizes: Sizes, limits: Float[np.ndarray, " n"], start: int, stop: int, width: int
) -> tuple[int, int, Bool[np.ndarray, " b"]]:
    """First and last frame [first, last) of the shaking, and bodies that shake along; `sizes`: turns, then places."""
    others = np.concatenate([sizes[: max(start - width, 0)], sizes[stop + width :]])
    others = others if len(others) >= width else sizes
    inner = slice(min(start + 1, stop - 1), max(stop - 1, start + 2))
    inside = np.median(sizes[inner], axis=0) / MEDIAN_SIZE
    outside = np.percentile(others, OFTEN_PERCENTILE, axis=0) / QUARTER_SIZE
    clear = inside > np.maximum(CLEARLY * outside, limits / 4.0)
    along = (clear & (inside * MEDIAN_SIZE > limits)).reshape(2, -1).any(axis=0)
    if not clear.any():
        return start, stop, along
    scales = inside[clear], np.maximum(outside[clear], inside[clear] / 100.0)
    middle = (start + stop) // 2
    first = _first(sizes[: middle + 1, clear], scales, start, width)
    last = len(sizes) - _first(sizes[middle:][::-1, clear], scales, len(sizes) - stop, width)
    return first, last, along


def _first(sizes: Sizes, scales: tuple[np.ndarray, np.ndarray], start: int, width: int) -> int:
    """The first frame that shakes, of those within `width` of `start`: `sizes` end in the middle of the shaking."""
    inside, outside = scales
    low = max(start - width, 0)
    frames = np.arange(low, len(sizes))
    best, found = -np.inf, start
    for first in range(low, min(start + width, len(sizes))):
        share = np.ones(len(frames))
        share[frames < first - REACH] = 0.0
        for offset, spill in enumerate(SPILL):
            share[frames == first - REACH + offset] = spill
        scale = np.hypot(outside, share[:, None] * inside)
        log_ratio = -3.0 * np.log(scale) - 0.5 * (FREEDOM + 3.0) * np.log1p((sizes[low:] / scale) ** 2 / FREEDOM)
        if log_ratio.sum() > best:
            best, found = float(log_ratio.sum()), first
    return found
