"""Meshes of the primitives against their closed formulas."""

import numpy as np
import pytest

from pipeline.errors import UnknownNameError
from pipeline.viewing.robot_figure import shape_mesh

SIZES = {
    "box": (0.1, 0.2, 0.3),
    "sphere": (0.2,),
    "ellipsoid": (0.1, 0.2, 0.3),
    "capsule": (0.05, 0.2),
    "cylinder": (0.05, 0.2),
}
VOLUMES = {
    "box": 8 * 0.1 * 0.2 * 0.3,
    "sphere": 4 / 3 * np.pi * 0.2**3,
    "ellipsoid": 4 / 3 * np.pi * 0.1 * 0.2 * 0.3,
    "capsule": np.pi * 0.05**2 * 0.4 + 4 / 3 * np.pi * 0.05**3,
    "cylinder": np.pi * 0.05**2 * 0.4,
}


def _volume(vertices, faces):
    """Divergence theorem: positive only when the triangles face outward and close the body."""
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    return float(np.sum(np.einsum("ij,ij->i", a, np.cross(b, c))) / 6)


@pytest.mark.parametrize("kind", SIZES)
def test_a_mesh_encloses_the_volume_of_its_primitive(kind):
    vertices, faces = shape_mesh(kind, SIZES[kind], 96)
    assert _volume(vertices, faces) == pytest.approx(VOLUMES[kind], rel=5e-3)


@pytest.mark.parametrize("kind", SIZES)
def test_every_edge_of_a_mesh_is_shared_by_two_triangles_in_opposite_directions(kind):
    _, faces = shape_mesh(kind, SIZES[kind], 12)
    edges = {(int(face[i]), int(face[(i + 1) % 3])) for face in faces for i in range(3)}
    assert len(edges) == 3 * len(faces)
    assert all((b, a) in edges for a, b in edges)


def test_the_vertices_of_a_capsule_lie_on_its_surface():
    radius, half = SIZES["capsule"]
    vertices, _ = shape_mesh("capsule", SIZES["capsule"], 16)
    on_axis = np.stack([np.zeros(len(vertices)), np.zeros(len(vertices)), np.clip(vertices[:, 2], -half, half)], axis=1)
    assert np.allclose(np.linalg.norm(vertices - on_axis, axis=1), radius)


def test_an_unknown_primitive_is_named():
    with pytest.raises(UnknownNameError, match="unknown primitive 'torus'; there are: box"):
        shape_mesh("torus", (1.0,), 8)
