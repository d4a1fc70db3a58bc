"""What goes wrong with a gait short of a fall: stumbles and slipping feet."""

from __future__ import annotations

import numpy as np

from pipeline import time_series
from pipeline.failures.failure import Failure
from pipeline.failures.settings import SlipSettings, StumbleSettings
from pipeline.failures.signals import Signals

LOW = 0.006
"""A sole whose lowest corner is within this of the lower foot's is on the ground [m]."""
FIRM_S = 0.05
"""Time after touchdown and before lift-off that does not count as standing [s]."""


def stumbles(signals: Signals, settings: StumbleSettings, until_s: float) -> list[Failure]:
    """Moments of much tilt or fast roll and pitch without a fall, before `until_s`."""
    width = max(round(0.1 * signals.fps) | 1, 1)
    gyro = np.nan_to_num(np.asarray(signals.trial.gyro_b, dtype=float))[:: signals.every, :2]
    rate = np.linalg.norm(time_series.moving_mean(gyro, width), axis=1)
    upset = ((signals.tilt_deg > settings.tilt_deg) | (rate > settings.rate)) & signals.known
    upset &= signals.time_s < until_s
    found: list[Failure] = []
    for start, stop in time_series.runs(upset):
        time_s = float(signals.time_s[start])
        if found and time_s - found[-1].until_s < settings.settle_s:
            continue
        tilt, turning = float(signals.tilt_deg[start:stop].max()), float(rate[start:stop].max())
        over = max(tilt / settings.tilt_deg, turning / settings.rate)
        forward, lateral, yaw = signals.command[start].tolist()
        found.append(
            Failure(
                kind="stumble",
                time_s=time_s,
                until_s=float(signals.time_s[stop - 1]),
                command=(forward, lateral, yaw),
                confidence=min(0.7 + 0.5 * (over - 1.0), 0.95),
                evidence={"largest tilt [deg]": tilt, "roll and pitch rate [rad/s]": turning},
            )
        )
    return found


def standing_feet(signals: Signals) -> np.ndarray:
    """Soles (n, 2) that stand firmly: on the ground since `FIRM_S` and for as long on."""
    down = signals.sole_height < LOW
    margin = round(FIRM_S * signals.fps)
    firm = np.zeros_like(down)
    for side in range(2):
        for start, stop in time_series.runs(down[:, side]):
            firm[start + margin : max(stop - margin, start + margin), side] = True
    return firm


def slips(signals: Signals, settings: SlipSettings, until_s: float) -> list[Failure]:
    """Windows in which bearing soles slide."""
    firm = standing_feet(signals)
    slides = np.any(firm & (signals.sole_speed > settings.foot_m_s), axis=1) & signals.known
    slides &= signals.time_s < until_s
    return [
        _slip(signals, settings, start, stop, share)
        for start, stop, share in windows_over(slides, settings.share, settings.window_s, signals.fps)
    ]


def windows_over(mask: np.ndarray, share: float, window_s: float, fps: float) -> list[tuple[int, int, float]]:
    """Stretches [start, stop) of middles of windows of which more than a share is marked, and the largest share.

    At the ends a window has less in it but is as long.
    """
    part = window_sum(mask.astype(float), window_s, fps) / (window_s * fps)
    return [(start, stop, float(part[start:stop].max())) for start, stop in time_series.runs(part > share)]


def window_sum(values: np.ndarray, window_s: float, fps: float) -> np.ndarray:
    """Sum of `values` (n, ...) over the window around each; beyond the ends there is nothing."""
    half = round(0.5 * window_s * fps)
    total = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    place = np.arange(len(values))
    return total[np.minimum(place + half, len(values))] - total[np.maximum(place - half, 0)]


def _slip(signals: Signals, settings: SlipSettings, start: int, stop: int, share: float) -> Failure:
    half = round(0.5 * settings.window_s * signals.fps)
    within = slice(max(start - half, 0), stop + half)
    firm = standing_feet(signals)[within]
    speed = np.where(firm, signals.sole_speed[within], 0.0)
    forward, lateral, yaw = signals.command[start].tolist()
    return Failure(
        kind="slip",
        time_s=float(signals.time_s[start]),
        until_s=float(signals.time_s[stop - 1]),
        command=(forward, lateral, yaw),
        confidence=min(0.7 + 0.3 * (share / settings.share - 1.0), 0.95),
        evidence={"share of the time": share, "fastest bearing sole [m/s]": float(speed.max())},
    )
