"""Which foot is on the ground, told from the motion of its sole alone."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from pipeline import time_series
from pipeline.quality.sole import SoleMotion

CONTACT_HEIGHT = 0.01
"""Lowest corner below this [m]. With the speed below it agrees best with the forces of MuJoCo rollouts of a
published T1 walking policy (F1 .961 over 5,400 foot-frames; 5 cm alone gives .81)."""

ON_SPEED = 0.4
OFF_SPEED = 0.7
"""Speed of the sole [m/s] below which contact begins and above which it ends: hysteresis about the .5 m/s of
the same calibration (judgement)."""

SHORTEST_S = 0.04
"""Contacts and gaps shorter than this are not believed (judgement: two frames at 50 Hz)."""


def contact_from_sole(
    sole: SoleMotion,
    *,
    below: float = CONTACT_HEIGHT,
    on_speed: float = ON_SPEED,
    off_speed: float = OFF_SPEED,
    shortest_s: float = SHORTEST_S,
) -> Bool[np.ndarray, "t 2"]:
    """Contact of the left and right foot: lower than `below` [m] and slow, with hysteresis [m/s].

    Gaps shorter than `shortest_s` are closed first, then short contacts dropped.
    """
    low, speed = sole.height < below, sole.mean_speed
    contact = np.zeros(low.shape, dtype=bool)
    state = np.zeros(2, dtype=bool)
    for frame in range(len(low)):
        state = low[frame] & (speed[frame] < np.where(state, off_speed, on_speed))
        contact[frame] = state
    shortest = round(shortest_s * sole.fps)
    for side in range(2):
        for wanted in (False, True):
            for start, stop in time_series.runs(contact[:, side] == wanted):
                if stop - start < shortest and start > 0 and stop < len(contact):
                    contact[start:stop, side] = not wanted
    return contact
