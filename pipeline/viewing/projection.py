"""Figures as flat-shaded triangles in parallel projection, drawn from far to near (painter's algorithm)."""

import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.artist import Artist
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas
from matplotlib.transforms import IdentityTransform
from PIL import Image  # comes with matplotlib

from pipeline import rotation
from pipeline.viewing.figure import Color, Figure
from pipeline.viewing.robot_figure import shape_mesh

DPI = 100
"""Dots per inch, for the size of letters."""

SEGMENTS = 10
"""Corners of a circle."""

CONTACT: Color = (0.17, 0.63, 0.17)
"""Colour of a shoe in contact."""

GROUND: Color = (0.90, 0.90, 0.88)

AZIMUTH, ELEVATION = np.radians(-60.0), np.radians(12.0)
"""Azimuth and elevation of the camera from the figure: 0 in front of it, -pi/2 to its right."""

TO_VIEWER = np.array([np.cos(ELEVATION) * np.cos(AZIMUTH), np.cos(ELEVATION) * np.sin(AZIMUTH), np.sin(ELEVATION)])
ACROSS = np.array([-np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0])
UP = np.cross(TO_VIEWER, ACROSS)
LIGHT = rotation.normalize(np.array([0.35, -0.55, 0.76]))
"""Direction towards the light, in the figure's frame."""


@dataclass(kw_only=True)
class Triangles:
    """Triangles in the picture's plane, in the order they are drawn."""

    corners: Float[np.ndarray, "n 3 2"] = field(default_factory=lambda: np.zeros((0, 3, 2)))
    """[m]"""
    colors: Float[np.ndarray, "n 3"] = field(default_factory=lambda: np.zeros((0, 3)))
    """Red, green, blue, 0 to 1."""

    @property
    def count(self) -> int:
        return len(self.corners)

    def moved(self, shift: Float[np.ndarray, " 2"]) -> "Triangles":
        """The triangles moved by `shift` [m]."""
        return Triangles(corners=self.corners + shift, colors=self.colors)


def one_above_the_other(layers: Sequence[Triangles]) -> Triangles:
    """Concatenated layers, the last on top."""
    if not layers:
        return Triangles()
    return Triangles(
        corners=np.concatenate([each.corners for each in layers]),
        colors=np.concatenate([each.colors for each in layers]),
    )


def project(points: np.ndarray) -> np.ndarray:
    """Points (..., 3) as (across, up) in the picture (..., 2) [m]."""
    return np.stack([points @ ACROSS, points @ UP], axis=-1)


def ground_triangles(half_width: float) -> Triangles:
    """A square sheet of ground at z = 0 about the origin."""
    corners = project(half_width * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]))
    return Triangles(corners=corners[[[0, 1, 2], [0, 2, 3]]], colors=np.array([GROUND, GROUND]))


def pose_triangles(figure: Figure, frame: int, heading: float) -> Triangles:
    """One frame of a figure, its root above the origin, turned back by `heading` [rad]. Missing parts are left out."""
    back = rotation.about_z(-heading)
    root = figure.root_pos_w[frame] * np.array([1.0, 1.0, 0.0])
    drawn = figure.drawn(frame)
    if not drawn.any() or not np.isfinite(root).all():
        return Triangles()
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


def _painted(triangles: Float[np.ndarray, "n 3 3"], colors: Float[np.ndarray, "n 3"]) -> Triangles:
    """Triangles that face the viewer, shaded (Lambert and ambient light), the farthest first."""
    normal = rotation.normalize(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]))
    seen = normal @ TO_VIEWER > 1e-6
    triangles, normal, colors = triangles[seen], normal[seen], colors[seen]
    order = np.argsort(triangles.mean(axis=1) @ TO_VIEWER, kind="stable")
    bright = 0.55 + 0.45 * np.clip(normal @ LIGHT, 0.0, 1.0)
    shaded = np.round(colors * bright[:, None], 2)[order]
    return Triangles(corners=project(triangles[order]), colors=shaded)


Text = tuple[float, float, str, dict[str, Any]]
"""Place [m], text and style."""


def picture(
    dots: tuple[float, float],
    across: tuple[float, float],
    up: tuple[float, float],
    layers: Sequence[Triangles],
    texts: Sequence[Text] = (),
) -> np.ndarray:
    """RGB picture (h, w, 3) of `dots` (width, height) without margins over the ranges `across` and `up` [m]."""
    canvas = Canvas(figsize=(dots[0] / DPI, dots[1] / DPI), dpi=DPI)
    axes = canvas.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set(xlim=across, ylim=up)
    axes.add_artist(TriangleArtist(one_above_the_other(layers)))
    for x, y, text, style in texts:
        axes.text(x, y, text, parse_math=False, **style)  # a name may hold a $
    agg = FigureCanvasAgg(canvas)
    agg.draw()
    return np.ascontiguousarray(np.asarray(agg.buffer_rgba())[..., :3])


def with_palette(pixels: np.ndarray, colours: int) -> Image.Image:
    """Reduce an RGB picture to its own palette, a third of the file size. Deterministic."""
    return Image.fromarray(pixels).quantize(colours, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)


def save_gif(target: Path | io.BytesIO, pictures: Iterable[np.ndarray], fps: float, colours: int) -> None:
    """Write RGB pictures as a GIF that repeats endlessly."""
    first, *others = [with_palette(each, colours) for each in pictures]
    first.save(target, "gif", save_all=True, append_images=others, duration=round(1000 / fps), loop=0, optimize=False)


class TriangleArtist(Artist):
    """Draws triangles of one colour each in list order, later ones on top.

    Agg widens each triangle by half a dot, so that there are no gaps between adjacent triangles.
    """

    def __init__(self, triangles: Triangles) -> None:
        super().__init__()
        self._triangles = triangles

    def draw(self, renderer: RendererBase) -> None:
        """Draw them in the data coordinates of the axes that they were added to."""
        count = self._triangles.count
        if not count or self.axes is None:
            return
        corners = self.axes.transData.transform(self._triangles.corners.reshape(-1, 2)).reshape(-1, 3, 2)
        opaque = np.column_stack([self._triangles.colors, np.ones(count)])
        context = renderer.new_gc()
        renderer.draw_gouraud_triangles(context, corners, np.repeat(opaque[:, None], 3, axis=1), IdentityTransform())
        context.restore()
