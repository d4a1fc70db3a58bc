"""Offsets of the feet that leave every stance as it was: one constant for each, led over from one to the next in swing.

stances of a foot -> an offset for each -> over the swings by the shortest jerk, so that position, speed and
acceleration of the offset have no step where a foot is put down or taken up
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float

from pipeline import time_series

SHORTEST_SWING_S = 0.2
"""Swings below it are not lifted [s]: they are a foot that shuffles or a label that flickers."""

PEAK = (0.4, 0.6)
"""Parts of a swing between which the lift may have its peak; nearer to an end it would be too steep."""

LEAST_POWER = 3.0
"""Of the time from each end of a swing: position, speed and acceleration of the lift begin and end at zero."""


def offset_by_stance(
    contact: Bool[np.ndarray, " t"], offset_at: Callable[[int], Float[np.ndarray, " 3"]]
) -> Float[np.ndarray, "t 3"]:
    """Offset of one foot over time.

    Args:
        contact: frames in which it stands
        offset_at: the offset for a frame: it is asked for the middle of each stance, and for the first and the last
            frame of the motion where the foot is in the air there
    """
    count = len(contact)
    knots = [(start, stop - 1, offset_at((start + stop - 1) // 2)) for start, stop in time_series.runs(contact)]
    if not contact[0]:
        knots.insert(0, (0, 0, offset_at(0)))
    if not contact[-1] and count > 1:
        knots.append((count - 1, count - 1, offset_at(count - 1)))
    offset = np.empty((count, 3))
    for first, last, value in knots:
        offset[first : last + 1] = value
    for (_, left, before), (put, _, after) in itertools.pairwise(knots):
        along = np.arange(1, put - left) / (put - left)
        offset[left + 1 : put] = before + shortest_jerk(along)[:, None] * (after - before)
    return offset


def shortest_jerk(along: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """From 0 to 1 over 0 to 1, speed and acceleration zero at both ends (Flash and Hogan 1985)."""
    return along**3 * (10.0 - 15.0 * along + 6.0 * along**2)


def lift_in_swings(
    contact: Bool[np.ndarray, " t"], height: Float[np.ndarray, " t"], fps: float
) -> Float[np.ndarray, " t"]:
    """0 in stances, and in each swing from 0 to 1 and back, with the 1 where the foot is highest, near the middle.

    Swings that the motion begins or ends in are left alone, as are those shorter than `SHORTEST_SWING_S`.
    """
    lift = np.zeros(len(contact))
    for start, stop in time_series.runs(~contact):
        if start == 0 or stop == len(contact) or (stop - start + 1) / fps < SHORTEST_SWING_S:
            continue
        along = (np.arange(start, stop) - start + 1) / (stop - start + 1)
        peak = float(np.clip(along[np.argmax(height[start:stop])], *PEAK))
        rise = LEAST_POWER * max(1.0, peak / (1.0 - peak))
        fall = rise * (1.0 - peak) / peak
        lift[start:stop] = (along / peak) ** rise * ((1.0 - along) / (1.0 - peak)) ** fall
    return lift
