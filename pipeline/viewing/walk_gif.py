"""A robot clip as a short animation, in place and from the front right like a contact sheet."""

from __future__ import annotations

import io

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas
from PIL import Image  # comes with matplotlib

from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.viewing.contact_sheet import POSE_WIDTH, ROBOT_HEIGHT_SHARE
from pipeline.viewing.projection import TriangleArtist, ground_triangles, one_above_the_other, pose_triangles
from pipeline.viewing.robot_figure import robot_figure

PALETTE = 32
DOTS_PER_M = 130
FPS = 12.5


def walk_gif(clip: RobotClip, robot: Robot, start_s: float = 0.0, seconds: float = 2.0) -> bytes:
    """GIF of `seconds` of a clip from `start_s` on, at its own speed; the same clip gives the same bytes."""
    figure = robot_figure(clip, robot)
    stop_s = min(start_s + seconds, figure.duration_s)
    frames = [figure.frame_at(float(time_s)) for time_s in np.arange(start_s, stop_s, 1.0 / FPS)] or [0]
    height = ROBOT_HEIGHT_SHARE * robot.default_root_height + 0.1
    heading = float(figure.heading[frames[0]])
    images = []
    for frame in frames:
        triangles = one_above_the_other([ground_triangles(0.45), pose_triangles(figure, frame, heading)])
        canvas = Canvas(figsize=(POSE_WIDTH * 1.2 * DOTS_PER_M / 100, height * DOTS_PER_M / 100), dpi=100)
        axes = canvas.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.set(xlim=(-0.6 * POSE_WIDTH, 0.6 * POSE_WIDTH), ylim=(-0.12, height - 0.12))
        axes.add_artist(TriangleArtist(triangles))
        agg = FigureCanvasAgg(canvas)
        agg.draw()
        images.append(Image.fromarray(np.asarray(agg.buffer_rgba())[..., :3].copy()))
    paletted = [image.quantize(PALETTE, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE) for image in images]
    stream = io.BytesIO()
    paletted[0].save(
        stream, "gif", save_all=True, append_images=paletted[1:], duration=round(1000 / FPS), loop=0, optimize=False
    )
    return stream.getvalue()
