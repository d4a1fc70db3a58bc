"""Bridge short gaps of a recording to measure velocities across them; the result is not used as motion.

A spline through the frames beside a gap is as good as anything up to .1 s (Sensors 21:6115, 2021) and keeps
accelerations; beyond it may overshoot, there a straight line tells the mean velocity and nothing else.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Bool, Float
from scipy.interpolate import CubicSpline

from pipeline import time_series
from pipeline.clips.human_clip import BODIES, HumanClip

SPLINE_S = 0.1
"""Longest gap that is bridged by a spline [s]."""
SPLINE_FRAMES = 4
"""Least recorded frames for a spline; fewer are interpolated linearly."""


def short_gaps(recorded: Bool[np.ndarray, " t"], fps: float, longest_s: float) -> Bool[np.ndarray, " t"]:
    """Frames in gaps up to `longest_s` [s] between two recorded frames, excluding the ends."""
    inside = np.zeros(len(recorded), dtype=bool)
    for start, stop in time_series.runs(~recorded):
        inside[start:stop] = start > 0 and stop < len(recorded) and (stop - start) / fps <= longest_s + 1e-9
    return inside


def bridge(
    values: Float[np.ndarray, "t k"], recorded: Bool[np.ndarray, " t"], fps: float, longest_s: float
) -> Float[np.ndarray, "t k"]:
    """Values with gaps up to `longest_s` [s] interpolated; all other values are unchanged."""
    inside = short_gaps(recorded, fps, longest_s)
    result = np.array(values, dtype=float)
    if not inside.any():
        return result
    known, gap = np.flatnonzero(recorded), np.flatnonzero(inside)
    for column in range(result.shape[1]):
        result[gap, column] = np.interp(gap, known, values[known, column])
    brief = np.flatnonzero(inside & short_gaps(recorded, fps, min(SPLINE_S, longest_s)))
    if len(known) >= SPLINE_FRAMES and len(brief):
        result[brief] = CubicSpline(known, values[known], axis=0)(brief)
    return result


def bridge_positions(clip: HumanClip, longest_s: float) -> HumanClip:
    """The clip with each body's positions bridged; orientations are unchanged."""
    recorded = np.asarray(np.isfinite(clip.body_pos_w).all(axis=2))
    if recorded.all():
        return clip
    pos = clip.body_pos_w.copy()
    for index in range(len(BODIES)):
        pos[:, index] = bridge(pos[:, index], recorded[:, index], clip.fps, longest_s)
    return dataclasses.replace(clip, body_pos_w=pos)
