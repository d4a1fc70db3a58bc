"""Triangle meshes of the primitives, in their own frames."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

from pipeline.errors import UnknownNameError

KINDS = ("box", "sphere", "ellipsoid", "capsule", "cylinder")

Mesh = tuple[Float[np.ndarray, "v 3"], Int[np.ndarray, "f 3"]]


@lru_cache(maxsize=512)
def shape_mesh(kind: str, size: tuple[float, ...], segments: int) -> Mesh:
    """Vertices [m] and triangles (seen from outside their corners run counterclockwise) of a primitive.

    Args:
        kind: one of `KINDS`
        size: as in `figure.Shape`
        segments: corners of a circle; the vertices lie on the true surface

    Raises UnknownNameError for another kind.
    """
    if kind not in KINDS:
        raise UnknownNameError("primitive", kind, KINDS)
    if kind == "box":
        return _box(size)
    if kind in ("sphere", "ellipsoid"):
        vertices, faces = _turned(_arc(segments), segments)
        return vertices * np.array(size if kind == "ellipsoid" else size[:1] * 3), faces
    radius, half = size[:2]
    if kind == "cylinder":
        return _turned([(0.0, -half), *_wall(radius, half), (0.0, half)], segments)
    arc = _arc(segments)
    middle = len(arc) // 2
    lower = [(radius * r, radius * z - half) for r, z in arc[:middle]]
    upper = [(radius * r, radius * z + half) for r, z in arc[middle + 1 :]]
    return _turned([*lower, *_wall(radius, half), *upper], segments)


def _arc(segments: int) -> list[tuple[float, float]]:
    """Half a unit circle as (distance from the axis, height), from the lower to the upper pole; odd count."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, 2 * max(segments // 4, 1) + 1)
    profile = [(float(np.cos(angle)), float(np.sin(angle))) for angle in angles]
    return [(0.0, -1.0), *profile[1:-1], (0.0, 1.0)]


def _wall(radius: float, half: float) -> list[tuple[float, float]]:
    """The side of a cylinder in bands about as high as its radius, so that triangles stay small and can be sorted."""
    bands = max(1, min(12, round(2 * half / radius)))
    return [(radius, float(z)) for z in np.linspace(-half, half, bands + 1)]


def _turned(profile: list[tuple[float, float]], segments: int) -> Mesh:
    """The solid that a profile of (distance, height) makes when turned about z; its ends lie on the axis."""
    turn = 2 * np.pi * np.arange(segments) / segments
    rings = [np.stack([r * np.cos(turn), r * np.sin(turn), np.full(segments, z)], axis=1) for r, z in profile[1:-1]]
    poles = np.array([[0.0, 0.0, profile[0][1]], [0.0, 0.0, profile[-1][1]]])
    vertices = np.concatenate([*rings, poles])
    here = np.arange(segments)
    after = (here + 1) % segments
    last, bottom, top = (len(rings) - 1) * segments, len(vertices) - 2, len(vertices) - 1
    faces = [np.stack([np.full(segments, bottom), after, here], axis=1)]
    for low in range(0, last, segments):
        high = low + segments
        faces.append(np.stack([low + here, low + after, high + after], axis=1))
        faces.append(np.stack([low + here, high + after, high + here], axis=1))
    faces.append(np.stack([last + here, last + after, np.full(segments, top)], axis=1))
    return vertices, np.concatenate(faces)


def _box(half: tuple[float, ...]) -> Mesh:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array(half[:3])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))])
    return corners, faces
