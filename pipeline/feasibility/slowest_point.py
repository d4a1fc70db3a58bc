"""Slip of a foot: the least horizontal speed over the part of its sole that is on the ground.

A pivoting foot slides at its corners but is at rest at a point between them, and a rolling foot is at rest where it
touches; neither slips. The velocity is linear over a rigid sole, so the velocities of the part on the ground fill the
convex polygon of its corners' velocities, and the slip is the distance of that polygon from zero.
"""

import functools
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float, Int

from pipeline.quality.sole import SoleMotion


def slowest_point_speed(sole: SoleMotion, level_m: float) -> Float[np.ndarray, "t 2"]:
    """Least horizontal speed [m/s] over the part of each sole on the ground: corners less than `level_m` [m] above the
    lowest one."""
    height = sole.corner_pos_w[..., 2]
    level = height <= height.min(axis=2, keepdims=True) + level_m
    return distance_from_zero(sole.corner_vel_w[..., :2], level)


def distance_from_zero(points: Float[np.ndarray, "*n c 2"], taken: Bool[np.ndarray, "*n c"]) -> Float[np.ndarray, "*n"]:
    """Distance of the convex hull of the `taken` points from the origin: 0 if it contains it, inf without points.

    The nearest point of the hull is one of the points, is on the line between two, or the origin within a triangle.
    """
    x, y = points[..., 0], points[..., 1]
    best = np.where(taken, np.sqrt(x * x + y * y), np.inf).min(axis=-1)
    first, second, threes, sides = _lines_and_triangles(points.shape[-2])
    start_x, start_y, end_x, end_y = x[..., first], y[..., first], x[..., second], y[..., second]
    way_x, way_y = end_x - start_x, end_y - start_y
    length_2 = np.maximum(way_x * way_x + way_y * way_y, 1e-12)
    share = np.clip(-(start_x * way_x + start_y * way_y) / length_2, 0.0, 1.0)
    near_x, near_y = start_x + share * way_x, start_y + share * way_y
    both = taken[..., first] & taken[..., second]
    distance = np.where(both, np.sqrt(near_x * near_x + near_y * near_y), np.inf)
    best = np.minimum(best, distance.min(axis=-1, initial=np.inf))
    around = (start_x * end_y - start_y * end_x)[..., sides] * [1.0, 1.0, -1.0]
    holds_zero = np.all(around > 0.0, axis=-1) | np.all(around < 0.0, axis=-1)
    return np.where((holds_zero & taken[..., threes].all(axis=-1)).any(axis=-1), 0.0, best)


@functools.cache
def _lines_and_triangles(corners: int) -> tuple[Int[np.ndarray, "..."], ...]:
    """Indices for a number of points: both ends of each line between two of them (l,), corners of each triangle (k, 3),
    and its sides as indices of lines (k, 3), the last one reversed."""
    pairs, threes = list(combinations(range(corners), 2)), list(combinations(range(corners), 3))
    sides = [[pairs.index(ends) for ends in ((one, two), (two, three), (one, three))] for one, two, three in threes]
    first, second = np.array(pairs, dtype=int).reshape(-1, 2).T
    return first, second, np.array(threes, dtype=int).reshape(-1, 3), np.array(sides, dtype=int).reshape(-1, 3)
