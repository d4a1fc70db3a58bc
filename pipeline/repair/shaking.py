"""Detect shaking: stretches in which bodies deviate from the interpolation of their neighbour frames continuously.

A body shakes in a window in which most frames have a large interpolation error. The edges are located separately: a bad
frame also affects the interpolation at two frames on either side, by a known share, and normal motion has small errors,
too. The edge is the change point of the error's scale with the largest likelihood over all bodies.
"""

import numpy as np
from jaxtyping import Bool, Float

from pipeline import time_series
from pipeline.repair.defect import Defect, spans
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.tree import FrameMask
from pipeline.repair.unsteadiness import REACH, MotionFeatures, slow_rate, turn_limits

NOISE_SPREAD, OFTEN_PERCENTILE = 3.0, 75.0
"""A body shakes where its error exceeds `NOISE_SPREAD` times this percentile of its errors in all other frames."""
FEWEST_FRAMES = 7
"""Least number of frames of a shaking window."""
SPILL: tuple[float, ...] = (0.12, 0.49, 0.87, 0.99)
"""Share of the full error in the two frames before the first shaking frame, in that frame and in the next one: white
noise through the interpolation weights (-1, 4, 6, 4, -1) / 6."""
MEDIAN_SIZE, QUARTER_SIZE = 1.54, 2.03
"""Median and upper quartile of the norm of a 3D normal vector with unit variance per axis."""
CLEARLY = 3.0
"""Ratio of the errors inside and outside from which a body is used for an edge, or counts as shaking too."""
FREEDOM = 3.0
"""Degrees of freedom of the Student distribution of errors; its tails allow large errors in single frames."""

Sizes = Float[np.ndarray, "t n"]


def find_noise(features: MotionFeatures, fps: float, settings: DetectionSettings) -> list[Defect]:
    """Stretches in which bodies shake: most frames deviate from the interpolation of their neighbours (`noise`)."""
    width = max(FEWEST_FRAMES, 2 * round(settings.noise_s * fps / 2.0) + 1)
    if len(features.pos_w) < width:
        return []
    turn, place = features.misses
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
    """Stretches from the first to the last rough frame of windows with mostly rough frames."""
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
    """75th percentile of a body's error outside `stretches`, or over all frames if few are outside."""
    outside = np.ones(len(size), dtype=bool)
    for start, stop in stretches:
        outside[max(start - width // 2, 0) : stop + width // 2] = False
    return float(np.percentile(size[outside] if outside.mean() > 0.5 else size, OFTEN_PERCENTILE))


def _located(
    sizes: Sizes, limits: Float[np.ndarray, " n"], start: int, stop: int, width: int
) -> tuple[int, int, Bool[np.ndarray, " b"]]:
    """Frames [first, last) of the shaking, and its bodies; `sizes`: errors of rotations, then of positions."""
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
    """The first shaking frame within `width` of `start`; `sizes` end in the middle of the shaking."""
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
