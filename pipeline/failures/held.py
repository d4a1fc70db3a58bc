"""Detect when a robot is held by a person or stopped by its operator; failures then are not the policy's."""

from dataclasses import dataclass, replace

import numpy as np

from pipeline import time_series
from pipeline.failures.failure import HELD, STOPPED, Failure
from pipeline.failures.settings import ExcuseSettings
from pipeline.failures.signals import Signals

UPRIGHT_DEG, TIPPED_DEG = 30.0, 60.0
"""Tilts, as a window's mean and at its centre, beyond which unloaded feet mean a fall, not a held robot."""
HARDEST_PULL = -0.2
"""Lower bound of the estimated share of the weight on the feet; smaller estimates are errors."""


@dataclass(frozen=True, kw_only=True)
class Excuse:
    """A time range [s] and the reason why failures in it are not the policy's."""

    start_s: float
    stop_s: float
    why: str
    evidence: dict[str, float | bool | str]


def excuses(signals: Signals, settings: ExcuseSettings) -> tuple[Excuse, ...]:
    """Time ranges in which the robot is held, and from the operator's stop to the end."""
    return (*_held(signals, settings), *_stopped(signals, settings))


def excuse_at(time_s: float, found: tuple[Excuse, ...], settings: ExcuseSettings) -> str:
    """Why a failure that began at a time is not the policy's; empty if there is no excuse."""
    for each in found:
        if each.start_s - settings.before_s <= time_s <= each.stop_s + settings.after_s:
            return each.why
    return ""


def excuse_failures(signals: Signals, found: tuple[Excuse, ...]) -> list[Failure]:
    """The intervals themselves, reported as `held` and `stopped`."""
    kinds = {HELD: "held", STOPPED: "stopped"}
    return [
        signals.failure(
            kinds[each.why], each.start_s, each.stop_s, confidence=0.95, excuse=each.why, evidence=each.evidence
        )
        for each in found
    ]


def _held(signals: Signals, settings: ExcuseSettings) -> list[Excuse]:
    """Time ranges in which the robot is held, from physics (unloaded feet) or the operator's notes."""
    support = np.clip(signals.support.sum(axis=1), HARDEST_PULL, 2.0)
    felt = signals.specific_force
    found = []
    for window_s, limit_deg in ((settings.window_s, UPRIGHT_DEG), (settings.short_s, TIPPED_DEG)):
        width = max(round(window_s * signals.fps) | 1, 1)
        reach = width if window_s == settings.window_s else 1
        tipped = time_series.moving_mean((signals.tilt_deg > limit_deg).astype(float), reach) > 0.0
        borne = time_series.moving_mean(support, width)
        hangs = ~tipped & signals.known & (borne < settings.support) & (felt > settings.specific_force)
        for start, stop in time_series.runs(hangs):
            if (stop - start) / signals.fps >= settings.short_s:
                half = 0.5 * window_s
                found.append(
                    Excuse(
                        start_s=max(float(signals.time_s[start]) - half, 0.0),
                        stop_s=float(signals.time_s[stop - 1]) + half,
                        why=HELD,
                        evidence={
                            "weight on the feet": float(borne[start:stop].min()),
                            "gravity felt": float(felt[start]),
                        },
                    )
                )
    return _joined(found) + _noted(signals)


def _joined(found: list[Excuse]) -> list[Excuse]:
    """Merge adjacent time ranges."""
    joined: list[Excuse] = []
    for each in sorted(found, key=lambda one: one.start_s):
        if joined and each.start_s <= joined[-1].stop_s:
            joined[-1] = replace(joined[-1], stop_s=max(each.stop_s, joined[-1].stop_s))
        else:
            joined.append(each)
    return joined


def _noted(signals: Signals) -> list[Excuse]:
    """Time ranges between the operator's events `held` and `released`."""
    end, since, found = float(signals.time_s[-1]), None, []
    for event in sorted(signals.trial.events, key=lambda each: each.time_s):
        if event.kind == "held":
            since = event.time_s if since is None else since
        elif event.kind == "released" and since is not None:
            found.append(Excuse(start_s=since, stop_s=event.time_s, why=HELD, evidence={"noted by": "the operator"}))
            since = None
    if since is not None:
        found.append(Excuse(start_s=since, stop_s=end, why=HELD, evidence={"noted by": "the operator"}))
    return found


def _stopped(signals: Signals, settings: ExcuseSettings) -> list[Excuse]:
    """Stops, from the operator's event or from joints that are only damped from some time on."""
    trial, end = signals.trial, float(signals.time_s[-1])
    times = [(event.time_s, "noted by the operator") for event in trial.events if event.kind == "stop"]
    times += [(time_s, "the joints' stiffness went to 0") for time_s in _damped(signals, settings.damping_kp)[:1]]
    if not times:
        return []
    time_s, how = min(times)
    return [Excuse(start_s=time_s, stop_s=end, why=STOPPED, evidence={"stop": how})]


def _damped(signals: Signals, damping_kp: float) -> list[float]:
    """Times at which the joints of an upright robot become only damped; damping during a fall is no stop.

    Samples with unknown stiffness are ignored.
    """
    kp = np.asarray(signals.trial.kp, dtype=float)
    known = np.isfinite(kp).any(axis=1)
    sent = np.nansum(kp, axis=1)
    if not known.any() or sent.max() <= 0.0:
        return []
    started = int(np.argmax(sent > 0.5 * sent.max()))
    damped = known & (sent < damping_kp * sent.max())
    damped[:started] = False
    times = (float(signals.trial.time_s[start]) for start, _ in time_series.runs(damped))
    return [time_s for time_s in times if signals.tilt_deg[signals.at(time_s)] < UPRIGHT_DEG]
