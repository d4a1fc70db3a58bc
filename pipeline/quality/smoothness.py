"""Smoothness of a motion: jerk and acceleration."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from pipeline import time_series


def percentile_of_least(values: Float[np.ndarray, " n"], percent: float, least: int) -> float:
    """Percentile of values that are 0 where there is no fault; fewer than `least` are filled up with zeros.

    Of 25 frames the 95th percentile is nearly the largest, so that one frame decides. Filled up to `least`, a short
    motion may have as many bad frames as one of that length, not fewer.
    """
    missing = max(least - values.size, 0)
    return float(np.percentile(np.concatenate([values.ravel(), np.zeros(missing)]), percent))


def mean_jerk(pos_w: Float[np.ndarray, "t 3"], fps: float, cutoff_hz: float) -> float:
    """Mean length of the third derivative of a position [m/s^3], low-passed at `cutoff_hz` (zero-phase) first."""
    if len(pos_w) < 4:
        return 0.0
    jerk = np.diff(time_series.smooth(pos_w, fps, cutoff_hz), n=3, axis=0) * fps**3
    return float(np.linalg.norm(jerk, axis=1).mean())


def acceleration_p99(values: Float[np.ndarray, "t j"], fps: float, cutoff_hz: float, least_frames: int = 0) -> float:
    """99th percentile of |second derivative| over all frames and columns, low-passed at `cutoff_hz` first.

    Fewer than `least_frames` frames are padded with zeros.
    """
    if len(values) < 3:
        return 0.0
    second = np.diff(time_series.smooth(values, fps, cutoff_hz), n=2, axis=0) * fps**2
    return percentile_of_least(np.abs(second).ravel(), 99, least_frames * values.shape[1])
