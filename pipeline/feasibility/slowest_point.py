"""How fast a foot slides: the speed of the point of its sole that slides least.

A foot that turns on the spot slides at its corners and stands at a point between them, and a foot that rolls stands
where it touches. Neither slides away. So the slip of a foot is the least horizontal speed over the part of the sole
that is on the ground. Velocity is linear over a rigid sole: those of this part fill the polygon of its corners'
velocities, and the least is the distance of that polygon from zero.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float

from pipeline.quality.sole import SoleMotion


def slowest_point_speed(sole: SoleMotion, level_m: float) -> Float[np.ndarray, "t 2"]:
    """Least horizontal speed [m/s] over the part of each sole that is level with its lowest corner: corners by less
    than `level_m` above it [m] are on the ground with it."""
    height = sole.corner_pos_w[..., 2]
    level = height <= height.min(axis=2, keepdims=True) + level_m
    return distance_from_zero(sole.corner_vel_w[..., :2], level)


def distance_from_zero(points: Float[np.ndarray, "*n c 2"], taken: Bool[np.ndarray, "*n c"]) -> Float[np.ndarray, "*n"]:
    """Distance of the convex hull of the points that are `taken` from zero: 0 where it holds it, infinite without any.

    The nearest point of the hull is a point, lies on the line between two, or is zero within a triangle of three.
    """
    best = np.where(taken, np.linalg.norm(points, axis=-1), np.inf).min(axis=-1)
    for pair in combinations(range(points.shape[-2]), 2):
        start, end = (points[..., one, :] for one in pair)
        way = end - start
        share = -np.sum(start * way, axis=-1) / np.maximum(np.sum(way**2, axis=-1), 1e-12)
        nearest = start + np.clip(share, 0.0, 1.0)[..., None] * way
        both = taken[..., list(pair)].all(axis=-1)
        best = np.where(both, np.minimum(best, np.linalg.norm(nearest, axis=-1)), best)
    for three in combinations(range(points.shape[-2]), 3):
        turns = np.stack(
            [_cross(points[..., three[one], :], points[..., three[one - 2], :]) for one in range(3)], axis=-1
        )
        holds_zero = np.all(turns > 0.0, axis=-1) | np.all(turns < 0.0, axis=-1)
        best = np.where(holds_zero & taken[..., list(three)].all(axis=-1), 0.0, best)
    return best


def _cross(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
