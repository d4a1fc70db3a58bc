"""How fast a foot slides: the speed of the point of its sole that slides least.

A foot that turns on the spot slides at its corners and stands at a point between them, and a foot that rolls stands
where it touches. Neither slides away. So the slip of a foot is the least horizontal speed over the part of the sole
that is on the ground. Velocity is linear over a rigid sole: those of this part fill the polygon of its corners'
velocities, and the least is the distance of that polygon from zero.
"""

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
    corners = range(points.shape[-2])
    pairs, threes = list(combinations(corners, 2)), list(combinations(corners, 3))
    first, second = np.array(pairs).reshape(-1, 2).T
    start, end = points[..., first, :], points[..., second, :]
    way = end - start
    share = -np.sum(start * way, axis=-1) / np.maximum(np.sum(way**2, axis=-1), 1e-12)
    nearest = start + np.clip(share, 0.0, 1.0)[..., None] * way
    both = taken[..., first] & taken[..., second]
    best = np.minimum(best, np.where(both, np.linalg.norm(nearest, axis=-1), np.inf).min(axis=-1, initial=np.inf))
    turns = _cross(start, end)
    for one, two, three in threes:
        around = turns[..., [pairs.index((one, two)), pairs.index((two, three)), pairs.index((one, three))]]
        around[..., 2] *= -1.0
        holds_zero = np.all(around > 0.0, axis=-1) | np.all(around < 0.0, axis=-1)
        best = np.where(holds_zero & taken[..., one] & taken[..., two] & taken[..., three], 0.0, best)
    return best


def _cross(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
