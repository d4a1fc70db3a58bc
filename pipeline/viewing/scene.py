"""Figures as nodes of a viser scene: one frame per part, one mesh per primitive."""

from __future__ import annotations

import numpy as np
import viser
from jaxtyping import Float

from pipeline import time_series
from pipeline.viewing.figure import Color, Figure, Shape
from pipeline.viewing.projection import CONTACT
from pipeline.viewing.shape_mesh import shape_mesh

SEGMENTS = 24
"""Corners of a circle."""

TILE = 0.25
"""Side of a square of the floor [m]."""

FLOOR_LENGTH, FLOOR_WIDTH = 4.0, 1.0
"""Size of a figure's own floor along x and y [m]; adjacent floors don't touch."""

PATH_CUTOFF_HZ = 0.4
"""Cutoff of the low-pass filter on the followed path [Hz], below any stride rate."""


class SceneFigure:
    """One figure in a scene, on a floor of its own, at its place beside the others."""

    def __init__(self, scene: viser.SceneApi, figure: Figure, place: Float[np.ndarray, " 3"]):
        self.figure = figure
        self._place = place
        self._path = _path(figure)
        self._root = scene.add_frame(f"/{figure.name}", show_axes=False, position=place)
        self._floor = scene.add_grid(
            f"/{figure.name}/floor",
            width=FLOOR_LENGTH,
            height=FLOOR_WIDTH,
            cell_size=TILE,
            cell_color=(170, 170, 170),
            section_size=TILE,
            section_color=(170, 170, 170),
            plane_color=(238, 238, 232),
            plane_opacity=1.0,
        )
        self.parts: list[viser.FrameHandle] = []
        self.meshes: list[list[viser.MeshHandle]] = []
        for part in figure.parts:
            name = f"/{figure.name}/{part.name}"
            self.parts.append(scene.add_frame(name, show_axes=False))
            self.meshes.append([add_shape(scene, name, index, shape) for index, shape in enumerate(part.shapes)])

    def show(self, time_s: float, follow: bool) -> None:
        """Move everything to the frame at a time. With `follow` the figure stays in its place and the floor moves."""
        frame = self.figure.frame_at(time_s)
        path = self._path[frame] if follow else np.zeros(3)
        self._root.position = self._place - path
        self._floor.position = np.rint(self._path[frame] / TILE) * TILE
        drawn = self.figure.drawn(frame)
        for index, part in enumerate(self.parts):
            part.visible = bool(drawn[index])
            if drawn[index]:
                part.position = self.figure.pos_w[frame, index]
                part.wxyz = self.figure.quat_w[frame, index]
        self._show_contacts(frame)

    def remove(self) -> None:
        """Take the figure out of the scene, with all that is below it."""
        self._root.remove()

    def _show_contacts(self, frame: int) -> None:
        if self.figure.contacts is None:
            return
        for part, meshes in zip(self.figure.parts, self.meshes, strict=True):
            if part.foot is None:
                continue
            on_ground = bool(self.figure.contacts[frame, part.foot])
            for shape, mesh in zip(part.shapes, meshes, strict=True):
                mesh.color = _rgb(CONTACT if on_ground else shape.color)


def add_shape(scene: viser.SceneApi, name: str, index: int, shape: Shape) -> viser.MeshHandle:
    """Add a primitive below a part's node; its mesh."""
    vertices, faces = shape_mesh(shape.kind, shape.size, SEGMENTS)
    return scene.add_mesh_simple(
        f"{name}/{index}",
        vertices=vertices.astype(np.float32),
        faces=faces.astype(np.uint32),
        color=_rgb(shape.color),
        flat_shading=shape.kind == "box",
        position=shape.pos,
        wxyz=shape.quat,
    )


def _rgb(color: Color) -> tuple[int, int, int]:
    red, green, blue = (round(255 * value) for value in color)
    return red, green, blue


def _path(figure: Figure) -> Float[np.ndarray, "t 3"]:
    """Low-passed ground position of the figure [m]; missing frames hold the last one."""
    path = figure.root_pos_w * np.array([1.0, 1.0, 0.0])
    known = np.flatnonzero(np.isfinite(path).all(axis=1))
    if not len(known):
        return np.zeros_like(path)
    held = known[np.clip(np.searchsorted(known, np.arange(len(path)), side="right") - 1, 0, None)]
    return time_series.smooth(path[held], figure.fps, PATH_CUTOFF_HZ)
