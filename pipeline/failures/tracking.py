"""Compare commanded and achieved velocity in stretches of steady command; estimate a delay that explains a
difference."""

import numpy as np

from pipeline import time_series
from pipeline.failures.failure import Failure
from pipeline.failures.settings import TrackingSettings
from pipeline.failures.signals import Signals

AXES = ("forward", "lateral", "yaw")
STEADY = 0.02
"""Change within 1 s below which a command is steady [m/s or rad/s]."""


def steady_stretches(signals: Signals, settings: TrackingSettings, until_s: float) -> list[tuple[int, int]]:
    """Sample ranges of steady command, without the settling time."""
    change = np.abs(time_series.derivative(signals.command, signals.fps)).max(axis=1)
    still = (change < STEADY) & signals.commanded & (signals.time_s < until_s)
    settle, least = round(settings.settle_s * signals.fps), round(settings.steady_s * signals.fps)
    return [(start + settle, stop) for start, stop in time_series.runs(still) if stop - start - settle >= least]


def tracking_divergences(signals: Signals, settings: TrackingSettings, until_s: float) -> list[Failure]:
    """Stretches whose mean velocity differs from the commanded one."""
    bounds = (settings.forward, settings.lateral, settings.yaw)
    achieved = np.column_stack([signals.velocity, signals.yaw_rate])
    found = []
    for start, stop in steady_stretches(signals, settings, until_s):
        within = np.arange(start, stop)[signals.known[start:stop]]
        if len(within) < 0.5 * (stop - start):
            continue
        command, mean = signals.command[start], achieved[within].mean(axis=0)
        over = [abs(mean[axis] - command[axis]) / (a + b * abs(command[axis])) for axis, (a, b) in enumerate(bounds)]
        axis = int(np.argmax(over))
        if over[axis] <= 1.0:
            continue
        delay, gain = delay_and_gain(signals, settings, start, stop)
        evidence: dict[str, float | bool | str] = {
            "commanded": float(command[axis]),
            "achieved": float(mean[axis]),
            "delay [s]": delay,
            "gain over the one sent": gain,
            **({"cause": "delay"} if delay > settings.delay_s else {}),
        }
        found.append(
            signals.failure(
                "tracking",
                signals.time_s[start],
                signals.time_s[stop - 1],
                direction=AXES[axis],
                confidence=min(0.7 + 0.5 * (over[axis] - 1.0), 0.95),
                evidence=evidence,
            )
        )
    return found


def delay_and_gain(signals: Signals, settings: TrackingSettings, start: int, stop: int) -> tuple[float, float]:
    """Delay of the targets [s] that explains the measured torques best, and the ratio of measured to commanded torque
    then.

    The model is torque = kp (target - position) - kd velocity with a delayed target. All delays are compared over the
    same samples, for which everything is known; without such samples the result is (0, 1).
    """
    trial = signals.trial
    joints = np.flatnonzero(np.nanstd(np.asarray(trial.target_pos, dtype=float), axis=0) > 1e-3)  # commanded joints
    rows = np.arange(start * signals.every, min(stop * signals.every, len(trial.time_s)))
    torque, target, kp = (
        np.asarray(each, dtype=float)[:, joints] for each in (trial.torque_est, trial.target_pos, trial.kp)
    )
    state = np.asarray(-trial.kp * trial.joint_pos - trial.kd * trial.joint_vel, dtype=float)[:, joints]
    lates = range(round(settings.longest_delay_s * trial.rate_hz) + 1)
    known = np.isfinite(torque[rows] + kp[rows] + state[rows])
    for late in lates:
        known &= np.isfinite(target[np.maximum(rows - late, 0)])
    best, found = np.inf, (0.0, 1.0)
    for late in lates if known.any() else ():
        asked = (kp[rows] * target[np.maximum(rows - late, 0)] + state[rows])[known]
        measured = torque[rows][known]
        slope = float(np.sum(asked * measured) / max(np.sum(asked**2), 1e-9))
        left = float(np.sum((measured - slope * asked) ** 2))
        if left < best:
            best, found = left, (late / trial.rate_hz, slope)
    return found
