"""Where the pelvis must be held to the human's path: it is where the first pass lets its velocity go astray.

The pelvis follows softly, so that legs can take the human's directions. Where feet are moved or legs are at their
limits, frame-wise IK lets it drift away slowly and come back with a jerk. There it is held by a larger weight, which
comes and goes with the error.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import distance_transform_edt, gaussian_filter1d

from pipeline import time_series
from pipeline.retarget.settings import PelvisSettings


def held_share(
    planned_w: Float[np.ndarray, "t 3"], reached_w: Float[np.ndarray, "t 3"], settings: PelvisSettings, fps: float
) -> Float[np.ndarray, " t"]:
    """How firmly the pelvis is held in each frame, 0 (softly) to 1, from the first pass's path.

    0 in a clip whose RMS error of the horizontal velocity over `window_s` stays within `tolerated_m_s`. Else it grows
    with that error from `free_m_s` to `astray_m_s`, and comes and goes over `fade_s`.
    """
    astray = time_series.smooth((reached_w - planned_w)[:, :2], fps, settings.cutoff_hz)
    error = time_series.derivative(astray, fps)
    width = 2 * round(settings.window_s * fps / 2.0) + 1
    rms = np.sqrt(time_series.moving_mean(np.sum(error * error, axis=1), width))
    if rms.max() <= settings.tolerated_m_s:
        return np.zeros(len(rms))
    share = np.clip((rms - settings.free_m_s) / (settings.astray_m_s - settings.free_m_s), 0.0, 1.0)
    return gaussian_filter1d(share, settings.fade_s * fps, mode="nearest", truncate=3.0)


def fading_grip(firm: Bool[np.ndarray, "t 2"], settings: PelvisSettings, fps: float) -> Float[np.ndarray, "t 2"]:
    """How firmly each foot is held to its place: 1 where `firm`, fading to 0 over `fade_s` outside."""
    grip = firm.astype(float)
    reach = settings.fade_s * fps
    for side in range(2):
        if not firm[:, side].any():
            continue
        distance = np.asarray(distance_transform_edt(~firm[:, side]))
        away = np.clip(1.0 - distance / (reach + 1.0), 0.0, 1.0)
        grip[:, side] = away**2 * (3.0 - 2.0 * away)
    return grip
