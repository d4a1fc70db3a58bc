"""Meshes of a manufacturer's model: their vertices, and primitives that replace them."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float

from pipeline import rotation

MESH_DECIMALS = 4
"""Decimals of mesh dimensions [m]: rounded to 0.1 mm, so that left and right are equal."""
FLAT = 0.002
"""Height above the lowest point up to which points belong to the bottom of a foot [m]."""
ROUND = 1.3
"""Largest ratio of the longest extent to the mean of the others for a sphere; otherwise a capsule."""
FILLED = 0.9
"""Ratio of radius to mean half extent, since the corners of the bounds are empty."""


def mesh_points(path: Path, scale: Sequence[float]) -> Float[np.ndarray, "n 3"]:
    """Vertices of a mesh file in its own frame [m]. Raises ValueError for a file that is no mesh."""
    try:
        mesh = trimesh.load_mesh(path, process=False)
        points = np.asarray(mesh.vertices, dtype=float) * np.asarray(scale)
    except (MemoryError, OSError):
        raise
    except Exception as error:  # each format of the library raises its own errors
        raise ValueError(f"the mesh '{path.name}' cannot be read ({error}), so its shape is missing.") from error
    if points.ndim != 2 or len(points) < 4 or not np.isfinite(points).all():
        raise ValueError(f"the mesh '{path.name}' has no usable vertices, so its shape is missing.")
    return points


def primitive_of(
    points: Float[np.ndarray, "n 3"],
) -> tuple[str, Float[np.ndarray, " 3"], Float[np.ndarray, " 4"], tuple[float, ...]]:
    """(kind, position, orientation wxyz, size) of the sphere or capsule along a link axis that replaces a mesh."""
    low, high = points.min(axis=0), points.max(axis=0)
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    axis = int(np.argmax(half))
    others = np.delete(half, axis)
    radius = FILLED * float(others.mean())
    if half[axis] <= ROUND * others.mean():
        return "sphere", centre, rotation.IDENTITY, (FILLED * float(half.mean()),)
    turn = {0: (0.0, np.pi / 2, 0.0), 1: (np.pi / 2, 0.0, 0.0), 2: (0.0, 0.0, 0.0)}[axis]
    quat = rotation.from_rotvec(np.array(turn))
    return "capsule", centre, quat, (radius, float(half[axis]) - radius)


def sole_box(points: Float[np.ndarray, "n 3"]) -> tuple[Float[np.ndarray, " 3"], tuple[float, float, float]]:
    """(position, half extents) of the box on the flat bottom of a foot's mesh; it is half as high as the foot."""
    bottom, top = float(points[:, 2].min()), float(points[:, 2].max())
    flat = points[points[:, 2] <= bottom + FLAT]
    low, high = flat.min(axis=0)[:2], flat.max(axis=0)[:2]
    bottom = round(bottom, MESH_DECIMALS)
    height = round(0.25 * (top - bottom), MESH_DECIMALS)
    centre = np.array([*(0.5 * (low + high)), bottom + height])
    half_x, half_y = (0.5 * (high - low)).tolist()
    return centre, (half_x, half_y, height)
