"""The ten skills as regions of planar motion, and the distance of a frame from each.

A skill is a region in the space of forward velocity, velocity to the left and yaw rate, each smoothed over a
fraction of a step. The distance of a frame from a region is 0 inside and grows with the change of
velocity needed to enter it, so that a frame just outside costs little and a frame of another skill costs much.

Every frame has a cost for every label and every cut has a price. The optimum over all segmentations is found by
dynamic programming (Viterbi with a least duration per label), so no gaps have to be merged afterwards, and a stretch
ends where that is cheapest, not where a threshold is first crossed.
"""

import itertools
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Float, Int

from pipeline.files.ranges import POSITIVE, Range, check, increasing


def segment(
    cost: Float[np.ndarray, "t k"], shortest: Int[np.ndarray, " k"], cut_price: float
) -> list[tuple[int, int, int]]:
    """Stretches `(start, stop, label)` that tile the frames at the least cost; neighbours differ in label.

    `shortest` is the least number of frames of each label. A clip too short for any of them gives one stretch of the
    label that is cheapest throughout.
    """
    count, labels = cost.shape
    if count < shortest.min():
        return [(0, count, int(np.argmin(cost.sum(axis=0))))]
    total = np.concatenate([np.zeros((1, labels)), np.cumsum(cost, axis=0)])
    best = np.full((count + 1, labels), np.inf)
    start = np.zeros((count + 1, labels), dtype=int)
    entry = np.full((count + 1, labels), np.inf)
    entry[0] = 0.0
    every = np.arange(labels)
    for stop in range(1, count + 1):
        stay = best[stop - 1] + cost[stop - 1]
        begun = stop - shortest
        allowed = begun >= 0
        begun = np.maximum(begun, 0)
        fresh = np.where(allowed, entry[begun, every] + total[stop] - total[begun, every], np.inf)
        best[stop] = np.minimum(stay, fresh)
        start[stop] = np.where(fresh < stay, begun, start[stop - 1])
        entry[stop] = cut_price + _least_of_others(best[stop])
    return _walk_back(best, start)


def _least_of_others(values: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
    """For each entry the minimum of all others."""
    first, second = np.partition(values, 1)[:2]
    others = np.full_like(values, first)
    others[np.argmin(values)] = second
    return others


def _walk_back(best: np.ndarray, start: np.ndarray) -> list[tuple[int, int, int]]:
    stretches: list[tuple[int, int, int]] = []
    stop, label = len(best) - 1, int(np.argmin(best[-1]))
    while True:
        begun = int(start[stop, label])
        stretches.append((begun, stop, label))
        if begun == 0:
            return stretches[::-1]
        values = best[begun].copy()
        values[label] = np.inf
        stop, label = begun, int(np.argmin(values))


@dataclass(frozen=True, kw_only=True)
class SkillBounds:
    """Limits of each skill's region. Speeds are the person's (or robot's) own, not scaled."""

    stand_speed: Annotated[float, Range(0.0, 15.0, open_low=True)]
    """Speed below which a body stands or turns on the spot [m/s]."""
    stand_yaw_rate_deg_s: Annotated[float, Range(0.0, 360.0, open_low=True)]
    """Largest yaw rate while standing."""
    turn_speed: Annotated[float, Range(0.0, 15.0, open_low=True)]
    """Largest speed of a turn on the spot [m/s]."""
    turn_yaw_rate_deg_s: Annotated[float, Range(0.0, 360.0, open_low=True)]
    """Least yaw rate of a turn on the spot."""
    side_ratio: Annotated[float, Range(1.0, 10.0)]
    """Least ratio of sideways or backward speed to the perpendicular one."""
    ahead_ratio: Annotated[float, Range(1.0, 10.0)]
    """Least ratio of forward to lateral speed of a walk, since a diagonal walk is no skill. Runs need `side_ratio`
    only."""
    walk_slow_speed: Annotated[float, Range(0.0, 15.0, open_low=True)]
    """Forward speed at which slow walking becomes walking [m/s]."""
    walk_speed: Annotated[float, Range(0.0, 15.0, open_low=True)]
    """Forward speed at which walking becomes fast walking or jogging [m/s]."""
    jog_speed: Annotated[float, Range(0.0, 15.0, open_low=True)]
    """Forward speed at which jogging becomes running [m/s]."""
    turn_radius: Annotated[float, POSITIVE]
    """Factor from rad/s to m/s, so that distances can be added [m]."""

    def __post_init__(self) -> None:
        check(increasing(self, "stand_speed", "walk_slow_speed", "walk_speed", "jog_speed"))


def distances(
    forward: Float[np.ndarray, " t"],
    lateral: Float[np.ndarray, " t"],
    yaw_rate: Float[np.ndarray, " t"],
    bounds: SkillBounds,
) -> Float[np.ndarray, "t 10"]:
    """Distance [m/s] of every frame from the region of every skill, in the order of `SKILLS`.

    Turning and standing have priority where they overlap another region: a frame has to leave them to be a walk.
    """
    speed, turning = np.hypot(forward, lateral), np.abs(yaw_rate)
    radius = bounds.turn_radius
    stand = _over(speed, bounds.stand_speed) + radius * _over(turning, np.deg2rad(bounds.stand_yaw_rate_deg_s))
    turn_rate = np.deg2rad(bounds.turn_yaw_rate_deg_s)
    slow = _over(speed, bounds.turn_speed)
    turns = [slow + radius * _over(turn_rate, sign * yaw_rate) for sign in (1.0, -1.0)]
    leave_stand = np.maximum(bounds.stand_speed - speed, 0.0)
    inside_turn = np.minimum(_over(bounds.turn_speed, speed), radius * _over(turning, turn_rate))
    travel = np.maximum(leave_stand, inside_turn)
    ratio = bounds.side_ratio
    sides = [travel + _over(ratio * np.abs(forward), sign * lateral) for sign in (1.0, -1.0)]
    across = ratio * np.abs(lateral)
    back = travel + _over(across, -forward)
    edges = [0.0, bounds.walk_slow_speed, bounds.walk_speed, bounds.jog_speed, np.inf]
    ratios = [bounds.ahead_ratio] * 3 + [bounds.side_ratio]
    ahead = [
        travel + _over(ratio * np.abs(lateral), forward) + _over(low, forward) + _over(forward, high)
        for ratio, (low, high) in zip(ratios, itertools.pairwise(edges), strict=True)
    ]
    return np.stack([stand, *turns, *sides, back, *ahead], axis=1)


def _over(value: np.ndarray | float, limit: np.ndarray | float) -> np.ndarray:
    """Excess of `value` over `limit`, 0 below it."""
    return np.maximum(np.subtract(value, limit), 0.0)
