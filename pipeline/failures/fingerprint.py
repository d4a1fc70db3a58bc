"""Identifies a trial's sensor data: a short digest of each half second of absolute time.

Samples lie on a grid since 1970, so a copy of a log that is torn, split, stored otherwise or without its beginning has
the same digests wherever its bytes are whole.
"""

from __future__ import annotations

import hashlib

import numpy as np

from pipeline.hardware_logs.regular import LOST
from pipeline.hardware_logs.trial import ROUNDING_S, Trial

WINDOW_NS = 500_000_000
DIGITS = 8
"""Hex digits of a window."""
UNKNOWN = "-" * DIGITS
"""In place of a window that the trial does not have whole: at its ends, and where the log was damaged."""
SENSORS = ("joint_pos", "joint_vel", "torque_est", "rpy", "gyro_b", "acc_b")


def fingerprint_of(trial: Trial) -> str:
    """Digests of the windows in a row, from the one on that the trial begins in."""
    period_ns = round(1e9 / trial.rate_hz)
    windows = (trial.start_ns + np.arange(len(trial.time_s)) * period_ns) // WINDOW_NS
    damaged = np.zeros(len(windows), dtype=bool)
    for gap in trial.gaps:
        if gap.reason == LOST:
            damaged |= (trial.time_s > gap.start_s - ROUNDING_S) & (trial.time_s < gap.stop_s + ROUNDING_S)
    starts = np.flatnonzero(np.diff(windows, prepend=windows[0] - 1)).tolist()
    return "".join(
        _digest(trial, start, stop)
        if (stop - start) * period_ns >= WINDOW_NS and not damaged[start:stop].any()
        else UNKNOWN
        for start, stop in zip(starts, [*starts[1:], len(windows)], strict=True)
    )


def windows_of(fingerprint: str, start_ns: int) -> dict[int, str]:
    """Number of the window since 1970 -> its digest, where that is known."""
    first = start_ns // WINDOW_NS
    parts = [fingerprint[at : at + DIGITS] for at in range(0, len(fingerprint), DIGITS)]
    return {first + number: part for number, part in enumerate(parts) if part != UNKNOWN}


def _digest(trial: Trial, start: int, stop: int) -> str:
    found = hashlib.sha256()
    for name in SENSORS:
        found.update(np.ascontiguousarray(getattr(trial, name)[start:stop], dtype="<f4").tobytes())
    return found.hexdigest()[:DIGITS]
