"""Detect falls (from attitude and the robot's fall state), stumbles and slipping feet."""

import numpy as np

from pipeline import time_series
from pipeline.failures.failure import Failure
from pipeline.failures.held import Excuse, excuse_at
from pipeline.failures.settings import ExcuseSettings, FallSettings, SlipSettings, StumbleSettings
from pipeline.failures.signals import Signals

FALLING = 1
"""Least value of `/fall_down` that is a fall: falling, has fallen, getting up."""
UPRIGHT_DEG = 20.0
"""Tilt below which a robot has stood up again."""
BOTH, ATTITUDE_ALONE, FLAG_ALONE = 0.99, 0.9, 0.5
"""Confidence of a fall by its evidence: attitude and fall state, attitude alone, fall state alone."""


def falls(
    signals: Signals, settings: FallSettings, excused: tuple[Excuse, ...], excuse: ExcuseSettings
) -> list[Failure]:
    """Each fall once, from its onset. A robot that is down when a trial begins cannot fall until it has stood up."""
    upright = np.flatnonzero((signals.tilt_deg < settings.onset_deg) & signals.known)
    if not len(upright):
        return []
    tipped = [start for start, _ in time_series.runs((signals.tilt_deg > settings.tilt_deg) & signals.known)]
    tipped = [start for start in tipped if start > upright[0]]
    starts = [(start, True) for start in _apart(signals, tipped)]
    near, flags = settings.flag_s, [flag for flag in _flags(signals) if flag > upright[0]]
    starts += [
        (flag, False) for flag in flags if all(abs(signals.time_s[flag] - signals.time_s[one]) > near for one in tipped)
    ]
    return [_fall(signals, *each, settings, excused, excuse) for each in sorted(starts)]


def _apart(signals: Signals, tipped: list[int]) -> list[int]:
    """Keep only falls between which the robot stood up again."""
    kept: list[int] = []
    for start in tipped:
        if not kept or np.any(signals.tilt_deg[kept[-1] : start] < UPRIGHT_DEG):
            kept.append(start)
    return kept


def _flags(signals: Signals) -> list[int]:
    """Samples at which the robot's fall state starts."""
    state = signals.trial.fall_state[:: signals.every]
    return [start for start, _ in time_series.runs(state >= FALLING)]


def _fall(
    signals: Signals,
    start: int,
    by_attitude: bool,
    settings: FallSettings,
    excused: tuple[Excuse, ...],
    excuse: ExcuseSettings,
) -> Failure:
    onset = onset_of(signals, start, settings.onset_deg)
    time_s = float(signals.time_s[onset])
    after = signals.at(time_s + settings.flag_s)
    flagged = any(
        abs(float(signals.time_s[flag]) - signals.time_s[start]) < settings.flag_s for flag in _flags(signals)
    )
    width = slice(onset, max(after, onset + 1))
    evidence: dict[str, float | bool | str] = {
        "attitude": by_attitude,
        "robot says so": flagged,
        "largest tilt [deg]": float(signals.tilt_deg[width].max()),
        "seconds from onset": float(signals.time_s[start]) - time_s,
    }
    pushed = push_before(signals, onset, start, settings)
    if pushed is not None:
        evidence |= {"cause": "push", "push [m/s]": pushed}
    return signals.failure(
        "fall",
        time_s,
        signals.time_s[start],
        direction=direction_of(signals, onset, start),
        confidence=BOTH if by_attitude and flagged else ATTITUDE_ALONE if by_attitude else FLAG_ALONE,
        excuse=excuse_at(time_s, excused, excuse) or excuse_at(float(signals.time_s[start]), excused, excuse),
        evidence=evidence,
    )


def onset_of(signals: Signals, fallen: int, onset_deg: float) -> int:
    """Index of the last sample before a fall with the trunk tilted less than `onset_deg`."""
    upright = np.flatnonzero(signals.tilt_deg[: fallen + 1] < onset_deg)
    return int(upright[-1]) if len(upright) else 0


def direction_of(signals: Signals, onset: int, fallen: int) -> str:
    """Direction in which the trunk leaned during the fall."""
    forward, left = signals.lean_b[onset : fallen + 1].mean(axis=0).tolist()
    if abs(forward) >= abs(left):
        return "forward" if forward > 0.0 else "backward"
    return "left" if left > 0.0 else "right"


def push_before(signals: Signals, onset: int, fallen: int, settings: FallSettings) -> float | None:
    """Velocity change [m/s] of the strongest push before a fall, from the accelerometer; None without a push."""
    width = max(round(settings.push_width_s * signals.fps) | 1, 1)
    mean = time_series.moving_mean(signals.acceleration_w, width)
    strength = np.linalg.norm(mean, axis=1)
    upright = signals.tilt_deg < 0.5 * settings.tilt_deg
    first = signals.at(float(signals.time_s[onset]) - settings.cause_s)
    near = np.arange(first, fallen + 1)
    near = near[upright[near] & signals.known[near]]
    if not len(near) or strength[near].max() < settings.push_m_s2:
        return None
    peak = near[int(np.argmax(strength[near]))]
    around = slice(max(peak - width, 0), peak + width + 1)
    change = float(np.linalg.norm(signals.acceleration_w[around].sum(axis=0) / signals.fps))
    return change if change > settings.push_m_s else None


LOW = 0.006
"""Largest height of a sole's lowest corner over the lower foot's for a sole on the ground [m]."""
FIRM_S = 0.05
"""Time after touchdown and before lift-off that does not count as stance [s]."""
LOADED = 0.2
"""Least share of the weight on a sole in stance, since a foot that swings close to the ground carries no load."""


def stumbles(signals: Signals, settings: StumbleSettings, until_s: float) -> list[Failure]:
    """Large tilts or roll and pitch rates without a fall, before `until_s`."""
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
        evidence = {"largest tilt [deg]": tilt, "roll and pitch rate [rad/s]": turning}
        confidence = min(0.7 + 0.5 * (over - 1.0), 0.95)
        found.append(
            signals.failure("stumble", time_s, signals.time_s[stop - 1], confidence=confidence, evidence=evidence)
        )
    return found


def standing_feet(signals: Signals) -> np.ndarray:
    """Mask (n, 2) of soles in firm stance: on the ground for `FIRM_S` before and after, with a load."""
    down = signals.sole_height < LOW
    margin = round(FIRM_S * signals.fps)
    firm = np.zeros_like(down)
    for side in range(2):
        for start, stop in time_series.runs(down[:, side]):
            firm[start + margin : max(stop - margin, start + margin), side] = True
    return firm & (signals.support > LOADED)


def slips(signals: Signals, settings: SlipSettings, until_s: float) -> list[Failure]:
    """Windows in which loaded soles slide."""
    firm = standing_feet(signals)
    slides = np.any(firm & (signals.sole_speed > settings.foot_m_s), axis=1) & signals.known
    slides &= signals.time_s < until_s
    return [
        _slip(signals, settings, start, stop, share)
        for start, stop, share in windows_over(slides, settings.share, settings.window_s, signals.fps)
    ]


def windows_over(mask: np.ndarray, share: float, window_s: float, fps: float) -> list[tuple[int, int, float]]:
    """Stretches [start, stop) of centres of windows with more than `share` of `mask`, and the largest share.

    Beyond the ends the mask counts as false.
    """
    part = window_sum(mask.astype(float), window_s, fps) / (window_s * fps)
    return [(start, stop, float(part[start:stop].max())) for start, stop in time_series.runs(part > share)]


def window_sum(values: np.ndarray, window_s: float, fps: float) -> np.ndarray:
    """Sum of `values` (n, ...) over the window centred at each sample; zero beyond the ends."""
    half = round(0.5 * window_s * fps)
    total = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    place = np.arange(len(values))
    return total[np.minimum(place + half, len(values))] - total[np.maximum(place - half, 0)]


def _slip(signals: Signals, settings: SlipSettings, start: int, stop: int, share: float) -> Failure:
    half = round(0.5 * settings.window_s * signals.fps)
    within = slice(max(start - half, 0), stop + half)
    firm = standing_feet(signals)[within]
    speed = np.where(firm, signals.sole_speed[within], 0.0)
    return signals.failure(
        "slip",
        signals.time_s[start],
        signals.time_s[stop - 1],
        confidence=min(0.7 + 0.3 * (share / settings.share - 1.0), 0.95),
        evidence={"share of the time": share, "fastest bearing sole [m/s]": float(speed.max())},
    )
