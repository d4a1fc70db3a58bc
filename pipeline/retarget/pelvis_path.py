"""Where the pelvis must be held to the human's path, and where its own path must be smoothed.

The pelvis follows softly, so that legs can take the human's directions. Where feet are moved or legs are at their
limits, frame-wise IK lets it drift away slowly and come back with a jerk. Two remedies, each from what a pass shows:

- Held: where the velocity goes astray the pelvis is held to the human's path by a larger weight, which comes and goes
  with the error.
- Smoothed: where it still accelerates much more than the person (a foot lands that a leg at its limit can barely
  reach), its way off the human's path is smoothed over the whole clip, and the pelvis is held to the smoothed path.
"""

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import distance_transform_edt, gaussian_filter1d, maximum_filter1d

from pipeline import rotation, time_series
from pipeline.retarget.foot_spacing import faded
from pipeline.retarget.settings import PelvisSettings

ACCELERATION_HZ = 10.0
"""Zero-phase low pass before accelerations are compared [Hz], that of KP5's criteria of the root."""


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


def smoothed_share(
    planned_w: Float[np.ndarray, "t 3"], reached_w: Float[np.ndarray, "t 3"], settings: PelvisSettings, fps: float
) -> Float[np.ndarray, " t"]:
    """How firmly the pelvis is held to `smoothed_path` in each frame, 0 (not at all) to 1.

    0 in a clip whose peak acceleration is within `jerky_ratio` of the planned path's. Else it is 1 around
    frames that accelerate by more than `smoothed_ratio` of that peak, and comes and goes over `fade_s`.
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
    """`planned_w` where `share` is 0; where it is 1, off it by a smooth version of the way [m] that `reached_w` is off.

    The horizontal way is low-passed. The vertical one is a smooth curve above most of it: a pelvis that is lower than
    the legs at their limits allow would press the feet into the ground.
    """
    way_w = time_series.smooth(reached_w - planned_w, fps, settings.path_hz)
    way_w[:, 2] = faded((reached_w - planned_w)[:, 2], settings.fade_s * fps)
    return planned_w + share[:, None] * way_w


def fading_grip(
    firm: Bool[np.ndarray, "t 2"], held: Float[np.ndarray, " t"], settings: PelvisSettings, fps: float
) -> Float[np.ndarray, "t 2"]:
    """How firmly each foot is held to its place: 1 where `firm`, fading to 0 over `fade_s` where the pelvis is held."""
    grip = firm.astype(float)
    reach = settings.fade_s * fps
    for side in range(2):
        if not firm[:, side].any():
            continue
        distance = np.asarray(distance_transform_edt(~firm[:, side]))
        fading = time_series.smoothstep(np.clip(1.0 - distance / (reach + 1.0), 0.0, 1.0))
        grip[:, side] = np.where(held > 0.0, fading, grip[:, side])
    return grip
