"""Where the pelvis task gets a larger weight on the human's path, and where its path is smoothed.

The pelvis task has a small weight, so that the legs can take the human's directions. Where feet are moved or legs are
at their limits, frame-wise IK lets the pelvis drift away slowly and return with a jerk. Two corrections, each computed
from the result of a pass:

- Held: where the pelvis velocity deviates, the pelvis task on the human's path gets a larger weight, which fades in and
  out with the error.
- Smoothed: where it still accelerates much more than the person (e.g. a leg at its limit can barely reach a foothold),
  its offset from the human's path is smoothed over the whole clip, and the pelvis tracks the smoothed path.
"""

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import distance_transform_edt, gaussian_filter1d, maximum_filter1d

from pipeline import rotation, time_series
from pipeline.retarget.foot_spacing import faded
from pipeline.retarget.settings import PelvisSettings

ACCELERATION_HZ = 10.0
"""Zero-phase low pass before accelerations are compared [Hz], as in KP5's criteria on the root."""


def held_share(
    planned_w: Float[np.ndarray, "t 3"], reached_w: Float[np.ndarray, "t 3"], settings: PelvisSettings, fps: float
) -> Float[np.ndarray, " t"]:
    """Interpolation factor of the pelvis weight in each frame, 0 (small) to 1 (`pelvis_held`), from the first pass's
    path.

    0 in a clip whose RMS error of the horizontal velocity over `window_s` stays within `tolerated_m_s`. Else it grows
    with that error from `free_m_s` to `astray_m_s`, with a fade-in and fade-out of `fade_s`.
    """
    astray = time_series.smooth((reached_w - planned_w)[:, :2], fps, settings.cutoff_hz)
    error = time_series.derivative(astray, fps)
    width = 2 * round(settings.window_s * fps / 2.0) + 1
    rms = np.sqrt(time_series.moving_mean(np.sum(error * error, axis=1), width))
    if rms.max() <= settings.tolerated_m_s:
        return np.zeros(len(rms))
    share = np.clip((rms - settings.free_m_s) / (settings.astray_m_s - settings.free_m_s), 0.0, 1.0)
    return gaussian_filter1d(share, settings.fade_s * fps, mode="nearest", truncate=3.0)


def smoothed_share(
    planned_w: Float[np.ndarray, "t 3"], reached_w: Float[np.ndarray, "t 3"], settings: PelvisSettings, fps: float
) -> Float[np.ndarray, " t"]:
    """Weight of `smoothed_path` for the pelvis in each frame, 0 (not used) to 1.

    0 in a clip whose peak acceleration is within `jerky_ratio` of the planned path's. Else it is 1 around
    frames that accelerate by more than `smoothed_ratio` of that peak, with a fade-in and fade-out of `fade_s`.
    """
    planned, reached = _acceleration(np.stack([planned_w, reached_w], axis=1), fps).T
    ratio = reached / max(planned.max(), settings.least_peak_m_s2)
    if ratio.max() <= settings.jerky_ratio:
        return np.zeros(len(ratio))
    fade = settings.fade_s * fps
    nearby = maximum_filter1d((ratio > settings.smoothed_ratio).astype(float), 4 * round(fade) + 1)
    return gaussian_filter1d(nearby, fade, mode="nearest", truncate=3.0)


def _acceleration(pos_w: Float[np.ndarray, "t n 3"], fps: float) -> Float[np.ndarray, "t n"]:
    """Magnitude of low-passed paths' acceleration [m/s^2]; 0 in the first and last frame."""
    acceleration = np.zeros(pos_w.shape[:2])
    smooth = time_series.smooth(pos_w, fps, ACCELERATION_HZ)
    acceleration[1:-1] = rotation.length(np.diff(smooth, n=2, axis=0)) * fps**2
    return acceleration


def smoothed_path(
    planned_w: Float[np.ndarray, "t 3"],
    reached_w: Float[np.ndarray, "t 3"],
    share: Float[np.ndarray, " t"],
    settings: PelvisSettings,
    fps: float,
) -> Float[np.ndarray, "t 3"]:
    """`planned_w` plus `share` times the smoothed offset [m] of `reached_w` from it.

    The horizontal offset is low-passed. The vertical one is replaced by its smooth upper envelope: a pelvis that is too
    low for legs at their limits would press the feet into the ground.
    """
    way_w = time_series.smooth(reached_w - planned_w, fps, settings.path_hz)
    way_w[:, 2] = faded((reached_w - planned_w)[:, 2], settings.fade_s * fps)
    return planned_w + share[:, None] * way_w


def fading_grip(
    firm: Bool[np.ndarray, "t 2"], held: Float[np.ndarray, " t"], settings: PelvisSettings, fps: float
) -> Float[np.ndarray, "t 2"]:
    """Interpolation factor of each foot's weights: 1 where `firm`, fading to 0 over `fade_s` at a held pelvis."""
    grip = firm.astype(float)
    reach = settings.fade_s * fps
    for side in range(2):
        if not firm[:, side].any():
            continue
        distance = np.asarray(distance_transform_edt(~firm[:, side]))
        fading = time_series.smoothstep(np.clip(1.0 - distance / (reach + 1.0), 0.0, 1.0))
        grip[:, side] = np.where(held > 0.0, fading, grip[:, side])
    return grip
