"""Detect motor failures: less torque than commanded, excessive speed, heat, lost packets."""

from collections.abc import Sequence

import numpy as np

from pipeline import time_series
from pipeline.actuators.adapted_robot import JointActuator
from pipeline.actuators.log_envelope import log_envelope
from pipeline.failures.failure import Failure
from pipeline.failures.falls import window_sum, windows_over
from pipeline.failures.settings import HeatSettings, PacketSettings, SpeedSettings, TorqueSettings
from pipeline.failures.signals import Signals

REACHED = 1.12
"""Ratio of the largest torque in the log to a plateau above which the plateau is no limit of the motor."""
MAD = 1.4826
"""Ratio of standard deviation to median absolute deviation of a normal distribution."""


def asked_torque(signals: Signals) -> np.ndarray:
    """Torque commanded by the joint controllers at each sample of the trial (m, j) [N m]; NaN before the first
    command."""
    trial = signals.trial
    position = np.asarray(trial.target_pos, dtype=float) - trial.joint_pos
    return trial.kp * position - trial.kd * trial.joint_vel + np.nan_to_num(trial.target_torque)


def torque_saturations(
    signals: Signals, actuators: Sequence[JointActuator], settings: TorqueSettings, until_s: float
) -> list[Failure]:
    """Joints whose torque has a plateau whenever more is commanded: a plateau below the calibrated limit at any time,
    or at that limit for a large share of a window."""
    trial = signals.trial
    used = trial.measured & (trial.time_s < until_s)
    asked = asked_torque(signals)
    torque, speed = np.asarray(trial.torque_est, dtype=float), np.asarray(trial.joint_vel, dtype=float)
    if not used.any():
        return []
    logs = log_envelope(actuators, speed[used], torque[used])
    found = []
    for joint, (actuator, log) in enumerate(zip(actuators, logs, strict=True)):
        limit = actuator.box_effort_limit
        short = (np.abs(asked[:, joint]) - np.abs(torque[:, joint]) > settings.asked_over * limit) & used
        short &= (np.sign(asked[:, joint]) == np.sign(torque[:, joint])) & (
            np.abs(speed[:, joint]) < actuator.box_velocity_limit
        )
        short = _long(short, settings.run_s, trial.rate_hz)
        if short.sum() < settings.least_s * trial.rate_hz:
            continue
        given = np.abs(torque[short, joint])
        level = float(np.median(given))
        spread = MAD * float(np.median(np.abs(given - level))) / max(level, 1e-6)
        if spread > settings.spread or log.max_torque > REACHED * level:
            continue
        failure = _saturation(signals, joint, short, level, spread, actuator, asked, settings)
        if failure is not None:
            found.append(failure)
    return found


def _long(mask: np.ndarray, least_s: float, rate_hz: float) -> np.ndarray:
    """Keep only stretches of at least `least_s`."""
    kept = np.zeros_like(mask)
    for start, stop in time_series.runs(mask):
        if stop - start >= least_s * rate_hz:
            kept[start:stop] = True
    return kept


def _saturation(
    signals: Signals,
    joint: int,
    short: np.ndarray,
    level: float,
    spread: float,
    actuator: JointActuator,
    asked: np.ndarray,
    settings: TorqueSettings,
) -> Failure | None:
    """The failure for a joint's plateau; None if it is the calibrated limit and rarely reached."""
    limit, trial = actuator.box_effort_limit, signals.trial
    windows = windows_over(short, settings.nominal_share, settings.window_s, trial.rate_hz)
    weak = level < settings.at_limit * limit
    if not weak and not windows:
        return None
    first = int(np.argmax(short)) if weak else windows[0][0]
    last = len(short) - 1 - int(np.argmax(short[::-1])) if weak else windows[-1][1] - 1
    seconds = float(short.sum() / trial.rate_hz)
    return signals.failure(
        "torque_saturation",
        trial.time_s[first],
        trial.time_s[last],
        joint=actuator.joint,
        confidence=np.clip(0.95 - 3.0 * spread * min(1.0, 0.5 / seconds), 0.5, 0.95),
        evidence={
            "given_n_m": level,
            "limit_n_m": limit,
            "asked_n_m": float(np.percentile(np.abs(asked[short, joint]), 90)),
            "seconds": seconds,
            "spread": spread,
            "weaker than calibrated": weak,
        },
    )


def speed_saturations(
    signals: Signals, actuators: Sequence[JointActuator], settings: SpeedSettings, until_s: float
) -> list[Failure]:
    """Joints that turn faster than their motors' limit for a share of a window."""
    trial = signals.trial
    speed = np.abs(np.asarray(trial.joint_vel, dtype=float))
    used = trial.measured & (trial.time_s < until_s)
    found = []
    for joint, actuator in enumerate(actuators):
        fast = (speed[:, joint] > settings.ratio * actuator.box_velocity_limit) & used
        for start, stop, share in windows_over(fast, settings.share, settings.window_s, trial.rate_hz)[:1]:
            found.append(
                signals.failure(
                    "speed_saturation",
                    trial.time_s[start],
                    trial.time_s[stop - 1],
                    joint=actuator.joint,
                    confidence=min(0.7 + 0.2 * (share / settings.share - 1.0), 0.95),
                    evidence={
                        "share of the time": share,
                        "fastest [rad/s]": float(speed[fast, joint].max()),
                        "limit [rad/s]": actuator.box_velocity_limit,
                    },
                )
            )
    return found


def hot_motors(signals: Signals, settings: HeatSettings) -> list[Failure]:
    """Motors above the allowed temperature."""
    trial = signals.trial
    temperature = np.nan_to_num(np.asarray(trial.temperature_c, dtype=float), nan=-273.0)
    found = []
    for joint, name in enumerate(trial.joint_names):
        hot = _long(temperature[:, joint] >= settings.temperature_c, settings.rise_s, trial.rate_hz)
        if hot.any():
            first = int(np.argmax(hot))
            found.append(
                signals.failure(
                    "overheating",
                    trial.time_s[first],
                    trial.time_s[len(hot) - 1 - int(np.argmax(hot[::-1]))],
                    joint=name,
                    confidence=0.95,
                    evidence={
                        "hottest [degC]": float(temperature[:, joint].max()),
                        "at the start [degC]": float(temperature[np.argmax(temperature[:, joint] > -200.0), joint]),
                    },
                )
            )
    return found


def lost_packets(signals: Signals, settings: PacketSettings) -> list[Failure]:
    """Windows in which motors lose packets, and gaps without any message."""
    trial = signals.trial
    lost = np.maximum(np.diff(trial.lost, axis=0, prepend=trial.lost[:1]), 0)
    lost = np.where(np.all(trial.lost >= 0, axis=1)[:, None], lost, 0).astype(float)
    rate = window_sum(lost, settings.window_s, trial.rate_hz) / settings.window_s
    found = []
    for start, stop in time_series.runs(np.any(rate > settings.lost_hz, axis=1)):
        worst = int(rate[start:stop].max(axis=0).argmax())
        evidence = {"packets lost a second": float(rate[start:stop].max())}
        start_s, stop_s, joint = trial.time_s[start], trial.time_s[stop - 1], trial.joint_names[worst]
        found.append(signals.failure("packet_loss", start_s, stop_s, confidence=0.95, joint=joint, evidence=evidence))
    for gap in trial.gaps:
        silence_s = gap.stop_s - gap.start_s
        if silence_s > settings.gap_s:
            evidence = {"silence [s]": silence_s}
            found.append(signals.failure("packet_loss", gap.start_s, gap.stop_s, confidence=0.95, evidence=evidence))
    return found
