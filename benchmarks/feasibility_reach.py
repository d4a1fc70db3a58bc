"""How far beyond a contact its force seems to reach in motion at 50 Hz: what `torque.told_reach_s` follows.

An acceleration at 50 Hz is over three frames and low-passed, so that an impact begins before it comes. Which foot bears
is the simulation's own word, and no criterion is asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from benchmarks.report import Bar
from pipeline import time_series
from pipeline.feasibility.motion import FPS
from pipeline.simulation.contact_wrench import GRAVITY
from pipeline.simulation.rollout import Rollout

FRAMES = 3
"""So many before and after a contact, in swings of more than twice as many."""
SHARES = (50.0, 90.0, 98.0)
"""Of swings [%]."""


@dataclass(frozen=True, kw_only=True)
class Beyond:
    """Vertical force over the weight that feet in the air seem to bear."""

    before: Float[np.ndarray, "s f"]
    """In the last frames before one comes down, the last one first."""
    after: Float[np.ndarray, "s f"]
    """In the first frames after it left."""


def beyond_contact(walk: Rollout, start_s: float, cutoff_hz: float) -> Beyond:
    """That of each swing from `start_s` [s] on, at the rate at which motions are judged, after a low pass at
    `cutoff_hz` as their torque is."""
    step = round(1.0 / walk.timestep_s / FPS)
    over_three = np.convolve(np.ones(step), np.ones(step)) / step**2
    force = np.stack([np.convolve(one, over_three, mode="same") for one in walk.foot_wrench_w[:, :, 2].T], axis=1)
    seen = time_series.smooth(force[::step], FPS, cutoff_hz) / (walk.robot.total_mass * GRAVITY)
    on, start = walk.contacts()[::step], round(start_s * FPS)
    before, after = [], []
    for side in range(2):
        for first, stop in time_series.runs(~on[start:, side]):
            if first > 0 and start + stop < len(on) and stop - first > 2 * FRAMES:
                swing = seen[start + first : start + stop, side]
                before.append(swing[::-1][:FRAMES])
                after.append(swing[:FRAMES])
    return Beyond(before=np.reshape(before, (-1, FRAMES)), after=np.reshape(after, (-1, FRAMES)))


def reach_bars(found: Sequence[Beyond]) -> list[Bar]:
    """For each frame beyond a contact how much of the weight the foot seems to bear there at most, of several shares of
    all swings."""
    count, bars = sum(len(one.before) for one in found), []
    if not count:
        return []
    for said in ("before", "after"):
        force = np.concatenate([getattr(one, said) for one in found])
        for frame in range(FRAMES):
            for share in SHARES:
                name = f"seems to bear, frame {frame + 1} {said} a contact, {share:g} % of {count} swings at most"
                bars.append(Bar(name=name, value=float(np.percentile(force[:, frame], share)), unit="of the weight"))
    return bars
