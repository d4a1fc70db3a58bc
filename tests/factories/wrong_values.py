"""Whether a trial of a damaged log states a value that the undamaged one does not."""

import numpy as np

from pipeline.hardware_logs import Trial
from tests.factories.damaged_logs import Damaged

EXACT = ("truncated", "flipped", "zeroed", "spliced", "bomb")
"""Damage that takes messages away; the others are left as they are."""
TOLERANCE = 1e-4
"""Where single messages were left out and their neighbours joined, on a robot that sways slowly."""
LINEAR = ("joint_pos", "joint_vel", "torque_est", "rpy", "gyro_b", "acc_b", "temperature_c")
HELD = ("target_pos", "target_torque", "kp", "kd", "odometer", "command")


def true_rows(trial: Trial, clean: Trial, log: Damaged) -> np.ndarray:
    """Row of the clean trial that each sample shows, -1 for none: by the time of receipt, as the log's clock had it."""
    period = round(1e9 / clean.rate_hz)
    true_ns = clean.start_ns + period * np.arange(len(clean.time_s))
    stamp = log.clock(true_ns) if log.clock else true_ns
    grid = trial.start_ns + period * np.arange(len(trial.time_s))
    place = np.searchsorted(np.sort(stamp), grid)
    order = np.argsort(stamp, kind="stable")
    known = (place < len(stamp)) & (np.sort(stamp)[np.minimum(place, len(stamp) - 1)] == grid)
    return np.where(known, order[np.minimum(place, len(stamp) - 1)], -1)


def wrong_values(trial: Trial, clean: Trial, log: Damaged) -> list[str]:
    """Columns with a value that is stated and is not the true one."""
    rows, tolerance, wrong = true_rows(trial, clean, log), 0.0 if log.kind in EXACT else TOLERANCE, []
    assert (rows >= 0).all(), "a sample at a time at which nothing was recorded"
    for name in (*LINEAR, *HELD):
        found, true = getattr(trial, name), getattr(clean, name)[rows]
        off = np.isfinite(found) & ~(np.abs(found - true) <= tolerance)
        if off.any():
            wrong.append(name)
    inside = trial.measured
    if (trial.lost[inside] != clean.lost[rows][inside]).any() and log.kind in EXACT:
        wrong.append("lost")
    if ((trial.fall_state != clean.fall_state[rows]) & (trial.fall_state != -1)).any():
        wrong.append("fall_state")
    return wrong
