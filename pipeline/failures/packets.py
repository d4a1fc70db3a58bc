"""Motors and messages that are not heard."""

from __future__ import annotations

import numpy as np

from pipeline import time_series
from pipeline.failures.failure import Failure
from pipeline.failures.gait import window_sum
from pipeline.failures.settings import PacketSettings
from pipeline.failures.signals import Signals


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
        found.append(_loss(signals, trial.time_s[start], trial.time_s[stop - 1], evidence, trial.joint_names[worst]))
    for gap in trial.gaps:
        if gap.stop_s - gap.start_s > settings.gap_s:
            found.append(_loss(signals, gap.start_s, gap.stop_s, {"silence [s]": gap.stop_s - gap.start_s}))
    return found


def _loss(signals: Signals, start_s: float, stop_s: float, evidence: dict[str, float], joint: str = "") -> Failure:
    forward, lateral, yaw = signals.command[signals.at(float(start_s))].tolist()
    return Failure(
        kind="packet_loss",
        time_s=float(start_s),
        until_s=float(stop_s),
        command=(forward, lateral, yaw),
        joint=joint,
        confidence=0.95,
        evidence=dict(evidence),
    )
