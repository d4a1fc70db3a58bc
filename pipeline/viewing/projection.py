"""Figures as flat shaded polygons: parallel projection, farther ones first (painter's algorithm)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.viewing.figure import Color, Figure
from pipeline.viewing.shape_mesh import shape_mesh

SEGMENTS = 10
"""Corners of a circle."""

CONTACT: Color = (0.17, 0.63, 0.17)
"""Of a shoe that is on the ground."""

GROUND: Color = (0.90, 0.90, 0.88)

AZIMUTH, ELEVATION = np.radians(-60.0), np.radians(12.0)
"""Where the viewer is, seen from the figure: 0 ahead of it, -pi/2 to its right; above the horizon."""

TO_VIEWER = np.array([np.cos(ELEVATION) * np.cos(AZIMUTH), np.cos(ELEVATION) * np.sin(AZIMUTH), np.sin(ELEVATION)])
ACROSS = np.array([-np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0])
UP = np.cross(TO_VIEWER, ACROSS)
LIGHT = rotation.normalize(np.array([0.35, -0.55, 0.76]))
"""Toward the light, in the figure's frame."""


@dataclass
class Polygons:
    """Polygons in the picture's plane [m], in the order they are drawn."""

    corners: list[Float[np.ndarray, "c 2"]] = field(default_factory=list)
    colors: list[Color] = field(default_factory=list)

    @property
    def count(self) -> int:
        return len(self.corners)

    def add(self, other: Polygons, shift: Float[np.ndarray, " 2"]) -> None:
        """Draw others on top, moved by `shift` [m]."""
        self.corners.extend(corners + shift for corners in other.corners)
        self.colors.extend(other.colors)


def project(points: np.ndarray) -> np.ndarray:
    """Points (..., 3) as (across, up) in the picture (..., 2) [m]."""
    return np.stack([points @ ACROSS, points @ UP], axis=-1)


def ground_polygon(half_width: float) -> Polygons:
    """A square sheet of ground at z = 0 about the origin."""
    corners = half_width * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return Polygons(corners=[project(corners)], colors=[GROUND])


def pose_polygons(figure: Figure, frame: int, heading: float) -> Polygons:
    """One frame of a figure, its root above the origin, turned back by `heading` [rad]. Missing parts are left out."""
    back = rotation.about_z(-heading)
    root = figure.root_pos_w[frame] * np.array([1.0, 1.0, 0.0])
    drawn = figure.drawn(frame)
    if not drawn.any() or not np.isfinite(root).all():
        return Polygons()
    shape_pos, shape_quat = figure.shape_poses(frame)
    pos = rotation.rotate(back, shape_pos - root)
    quat = rotation.multiply(back, shape_quat)
    triangles, colors = [], []
    index = 0
    for part, is_drawn in zip(figure.parts, drawn, strict=True):
        on_ground = part.foot is not None and figure.contacts is not None and bool(figure.contacts[frame, part.foot])
        for shape in part.shapes:
            if is_drawn:
                vertices, faces = shape_mesh(shape.kind, shape.size, SEGMENTS)
                placed = rotation.rotate(quat[index], vertices) + pos[index]
                triangles.append(placed[faces])
                colors.append(np.tile(CONTACT if on_ground else shape.color, (len(faces), 1)))
            index += 1
    return _painted(np.concatenate(triangles), np.concatenate(colors))


def _painted(triangles: Float[np.ndarray, "n 3 3"], colors: Float[np.ndarray, "n 3"]) -> Polygons:
    """Triangles that face the viewer, shaded (Lambert and ambient light), the farthest first."""
    normal = rotation.normalize(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]))
    seen = normal @ TO_VIEWER > 1e-6
    triangles, normal, colors = triangles[seen], normal[seen], colors[seen]
    order = np.argsort(triangles.mean(axis=1) @ TO_VIEWER, kind="stable")
    bright = 0.55 + 0.45 * np.clip(normal @ LIGHT, 0.0, 1.0)
    shaded = np.round(colors * bright[:, None], 2)[order]
    return Polygons(corners=list(project(triangles[order])), colors=[tuple(color) for color in shaded.tolist()])
