"""Poses along a clip in one picture: the human above, the robot below, at the same times and the same scale.

Seen from the front right, turned so that the clip starts facing to the right; every pose is moved to its own place, so
only height, posture and turning are shown, not the path. The ground is the grey sheet at z = 0; a shoe is green while
the clip says that the foot is on the ground.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure as Canvas
from PIL import Image  # comes with matplotlib

from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.viewing.figure import Figure
from pipeline.viewing.human_figure import human_figure
from pipeline.viewing.projection import CONTACT, Polygons, ground_polygon, pose_polygons
from pipeline.viewing.robot_figure import robot_figure

POSE_WIDTH = 1.05
"""Room for a pose [m]."""

TITLE_HEIGHT, TIME_HEIGHT, HEADROOM = 0.24, 0.22, 0.12
"""Of the line above a strip, of the line of times below a row and above a head [m]."""

HUMAN_HEIGHT = 1.80
"""Room for a human [m]; a robot has room for its default height and what its head adds."""

PALETTE = 96
"""Colours of the picture."""

ROBOT_HEIGHT_SHARE = 1.85
"""Height of a standing robot / height of its root link; T1: 1.23 m / .68 m."""


@dataclass(frozen=True, kw_only=True)
class Strip:
    """One clip of a sheet."""

    title: str
    human: HumanClip | None = None
    robot_clip: RobotClip | None = None


def contact_sheet(human: HumanClip | None, robot_clip: RobotClip | None, robot: Robot | None, poses: int = 8) -> bytes:
    """PNG of `poses` poses from the first frame to the last of a human clip, of a robot clip or of both.

    `robot` is the one that `robot_clip` is for. Raises ValueError when there is nothing to draw.
    """
    clip = robot_clip or human
    if clip is None:
        raise ValueError("a contact sheet needs a human clip or a robot clip")
    return worst_clips_sheet([Strip(title=clip.name, human=human, robot_clip=robot_clip)], robot, poses, dots_per_m=105)


def worst_clips_sheet(strips: Sequence[Strip], robot: Robot | None, poses: int = 8, dots_per_m: float = 70) -> bytes:
    """PNG of several clips, one below the other, each as in `contact_sheet` under its title."""
    drawn = _Drawing()
    for strip in strips:
        rows = [human_figure(strip.human)] if strip.human is not None else []
        if strip.robot_clip is not None and robot is not None:
            rows.append(robot_figure(strip.robot_clip, robot))
        drawn.add_strip(strip.title, rows, robot, poses)
    return drawn.png(poses * POSE_WIDTH, dots_per_m)


class _Drawing:
    """Polygons and texts gathered from the top down; `low` is the lower end so far [m]."""

    def __init__(self) -> None:
        self.polygons = Polygons()
        self.texts: list[tuple[float, float, str, dict]] = []
        self.low = 0.0

    def add_strip(self, title: str, rows: list[Figure], robot: Robot | None, poses: int) -> None:
        duration_s = max((figure.duration_s for figure in rows), default=0.0)
        times_s = np.linspace(0.0, duration_s, poses) if poses > 1 else np.zeros(1)
        self.low -= TITLE_HEIGHT
        self.texts.append((0.06, self.low + 0.06, f"{_shortened(title, poses)}, {duration_s:.1f} s", {"fontsize": 8}))
        for figure in rows:
            height = HUMAN_HEIGHT
            if figure.name != "human" and robot is not None:
                height = ROBOT_HEIGHT_SHARE * robot.default_root_height
            self.low -= height + HEADROOM
            self.texts.append((0.06, self.low + height, figure.name, {"fontsize": 7, "color": "#777777"}))
            for index, time_s in enumerate(times_s):
                self._add_pose(figure, float(time_s), (index + 0.5) * POSE_WIDTH)
            self.low -= TIME_HEIGHT
        for index, time_s in enumerate(times_s):
            place = ((index + 0.5) * POSE_WIDTH, self.low + 0.02)
            self.texts.append((*place, f"{time_s:.2f} s", {"fontsize": 6.5, "ha": "center", "color": "#555555"}))
        self.low -= 0.06

    def _add_pose(self, figure: Figure, time_s: float, across: float) -> None:
        frame = figure.frame_at(time_s)
        shift = np.array([across, self.low])
        self.polygons.add(ground_polygon(0.36), shift)
        pose = pose_polygons(figure, frame, _first_heading(figure))
        if pose.count == 0:
            self.texts.append((across, self.low + 0.5, "missing", {"fontsize": 7, "ha": "center", "color": CONTACT}))
        self.polygons.add(pose, shift)

    def png(self, width: float, dots_per_m: float) -> bytes:
        """The picture, `width` metres across."""
        canvas = Canvas(figsize=(width * dots_per_m / 100, max(-self.low, 0.3) * dots_per_m / 100), dpi=100)
        axes = canvas.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.set(xlim=(0.0, width), ylim=(min(self.low, -0.3), 0.0))
        colors = self.polygons.colors
        axes.add_collection(
            PolyCollection(self.polygons.corners, facecolors=colors, edgecolors=colors, linewidths=0.3),
            autolim=False,
        )
        for x, y, text, style in self.texts:
            axes.text(x, y, text, **{"va": "bottom", **style})
        return _palette_png(canvas)


def _palette_png(canvas: Canvas) -> bytes:
    """PNG of a canvas with a palette: a third of the size of full colour. Same canvas, same bytes."""
    agg = FigureCanvasAgg(canvas)
    agg.draw()
    image = Image.fromarray(np.asarray(agg.buffer_rgba())[..., :3].copy())
    stream = io.BytesIO()
    image.quantize(PALETTE, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(stream, "png")
    return stream.getvalue()


def _first_heading(figure: Figure) -> float:
    """Heading [rad] in the first frame that has one."""
    known = figure.heading[np.isfinite(figure.heading)]
    return float(known[0]) if len(known) else 0.0


def _shortened(title: str, poses: int) -> str:
    room = 15 * max(poses, 2)
    return title if len(title) <= room else f"{title[: room - 1]}…"
