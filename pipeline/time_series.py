"""Signals over time: derivatives, resampling by time, zero-phase smoothing, runs of frames."""

import functools

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline import rotation


def derivative(values: np.ndarray, fps: float) -> np.ndarray:
    """d/dt of `values` (t, ...) by central differences, one-sided at both ends; zero for one frame."""
    if len(values) < 2:
        return np.zeros_like(values, dtype=float)
    rate = np.empty(values.shape, dtype=np.result_type(values.dtype, np.float32))
    rate[1:-1] = (values[2:] - values[:-2]) / (2.0 * (1.0 / fps))
    rate[0], rate[-1] = ((values[one] - values[one - 1]) / (1.0 / fps) for one in (1, -1))
    return rate


def frame_times(frame_count: int, fps: float) -> np.ndarray:
    """Time [s] (t,) of each frame; the first is at 0."""
    return np.arange(frame_count) / fps


def resample_times(frame_count: int, fps: float, new_fps: float) -> np.ndarray:
    """Times [s] of the frames at `new_fps` that lie within the clip, the first at 0."""
    duration_s = (frame_count - 1) / fps
    return np.arange(int(np.floor(duration_s * new_fps + 1e-6)) + 1) / new_fps


def resample_linear(values: np.ndarray, fps: float, times_s: np.ndarray) -> np.ndarray:
    """Values (t, ...) at `times_s` by linear interpolation."""
    low, fraction = _bracket(len(values), fps, times_s)
    if not fraction.any():
        return values[low]
    high = np.minimum(low + 1, len(values) - 1)
    weight = fraction.reshape(-1, *([1] * (values.ndim - 1)))
    return values[low] * (1.0 - weight) + values[high] * weight


def resample_quat(quat: np.ndarray, fps: float, times_s: np.ndarray) -> np.ndarray:
    """Quaternions (t, ..., 4) at `times_s` by slerp, sign-continuous."""
    low, fraction = _bracket(len(quat), fps, times_s)
    if not fraction.any():
        return rotation.make_continuous(quat[low])
    high = np.minimum(low + 1, len(quat) - 1)
    weight = fraction.reshape(-1, *([1] * (quat.ndim - 2)))
    return rotation.make_continuous(rotation.slerp(quat[low], quat[high], weight))


def resample_nearest(values: np.ndarray, fps: float, times_s: np.ndarray) -> np.ndarray:
    """Labels (t, ...) at `times_s` from the nearest frame."""
    index = np.clip(np.rint(times_s * fps).astype(int), 0, len(values) - 1)
    return values[index]


def _bracket(frame_count: int, fps: float, times_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    position = np.clip(times_s * fps, 0.0, frame_count - 1)
    low = np.minimum(np.floor(position + 1e-9).astype(int), max(frame_count - 2, 0))
    return low, np.clip(position - low, 0.0, 1.0)


def smooth(values: np.ndarray, fps: float, cutoff_hz: float) -> np.ndarray:
    """Zero-phase low pass of `values` (t, ...): Butterworth order 2 run forward and back.

    The two runs together are biomechanics' "fourth-order zero-lag" filter (Winter 2009). Clips too short to pad by one
    period, or a cutoff near Nyquist (from .45 of the rate), come back unchanged.
    """
    if cutoff_hz >= 0.45 * fps:
        return np.array(values, dtype=float)
    pad = min(int(3 * fps / cutoff_hz), len(values) - 1)
    if pad < int(fps / cutoff_hz):
        return np.array(values, dtype=float)
    from scipy.signal import sosfilt  # 25 MB that readers do without

    sections, settled = _low_pass(float(cutoff_hz), float(fps))
    settled = settled.reshape(1, 2, *([1] * (values.ndim - 1)))
    before, after = 2.0 * values[:1] - values[pad:0:-1], 2.0 * values[-1:] - values[-2 : -2 - pad : -1]
    padded = np.concatenate([before, values, after])
    once = sosfilt(sections, padded, axis=0, zi=settled * padded[:1])[0][::-1]
    return sosfilt(sections, once, axis=0, zi=settled * once[:1])[0][::-1][pad:-pad]


@functools.cache
def _low_pass(cutoff_hz: float, fps: float) -> tuple[np.ndarray, np.ndarray]:
    """Second-order sections of a Butterworth low pass of order 2 that is at -3 dB at `cutoff_hz` when it is run twice,
    and their state after a long time of 1; designing it takes longer than running it."""
    from scipy.signal import butter, sosfilt_zi

    raised = fps / np.pi * np.arctan(np.tan(np.pi * cutoff_hz / fps) / (np.sqrt(2.0) - 1.0) ** 0.25)
    sections = np.asarray(butter(2, float(raised), fs=fps, output="sos"))
    return sections, np.asarray(sosfilt_zi(sections))


def moving_mean(values: np.ndarray, width: int) -> np.ndarray:
    """Centred mean over `width` frames (odd), shrinking at the ends, of `values` (t, ...)."""
    half = width // 2
    total = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    index = np.arange(len(values))
    low, high = np.maximum(index - half, 0), np.minimum(index + half + 1, len(values))
    return (total[high] - total[low]) / (high - low).reshape(-1, *([1] * (values.ndim - 1)))


def smoothstep(share: np.ndarray) -> np.ndarray:
    """A share of 0 to 1 (any shape) that leaves 0 and reaches 1 without a step in slope."""
    return share**2 * (3.0 - 2.0 * share)


def runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """Half-open frame ranges [start, stop) in which the boolean `mask` (t,) holds."""
    padded = np.zeros(len(mask) + 2, dtype=bool)
    padded[1:-1] = mask
    edges = np.flatnonzero(padded[1:] != padded[:-1]).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def without_short_runs(label: np.ndarray, shortest: int) -> np.ndarray:
    """Labels (t,) with inner gaps shorter than `shortest` frames closed, then inner runs shorter than that dropped."""
    result = label.copy()
    for wanted in (False, True):
        for start, stop in runs(result == wanted):
            if stop - start < shortest and start > 0 and stop < len(label):
                result[start:stop] = not wanted
    return result


def weighted_median(values: np.ndarray, weights: np.ndarray) -> float:
    """The value (n,) at which half of the total weight is reached, in ascending order."""
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, total[-1] / 2.0)])


def resample_cubic(values: np.ndarray, fps: float, times_s: np.ndarray) -> np.ndarray:
    """Values (t, ...) at `times_s` by a not-a-knot cubic spline; linear below four frames.

    Unlike linear interpolation it keeps accelerations: between frames they are not zero.
    """
    if len(values) < 4:
        return resample_linear(values, fps, times_s)
    return CubicSpline(frame_times(len(values), fps), values, axis=0)(np.clip(times_s, 0.0, (len(values) - 1) / fps))


def resample_quat_cubic(quat: np.ndarray, fps: float, times_s: np.ndarray) -> np.ndarray:
    """Quaternions (t, ..., 4) at `times_s`: the cubic spline of the sign-continuous components, renormalised."""
    return rotation.normalize(resample_cubic(rotation.make_continuous(quat), fps, times_s))
