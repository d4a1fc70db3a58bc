"""Poses along a clip in one picture: human, a rollout's reference and robot, at the same times and scale.

The view is from the front right; the clip starts facing right. Each pose has its own place, so the sheet shows height,
posture and turning, but not the path. The ground is the grey sheet at z = 0; a shoe is green while its foot is labelled
as in contact. `worst_clips` shows the clips that lost the most seconds in a
stage, with the reasons; `walk_gif` a robot clip as a short animation from the same point of view.
"""

import dataclasses
import io
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from pipeline.batch import Entry, Manifest, Store
from pipeline.batch.shard import rows_of
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Clip
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.viewing.figure import Figure
from pipeline.viewing.playlist import Shown
from pipeline.viewing.projection import (
    CONTACT,
    DPI,
    Text,
    Triangles,
    ground_triangles,
    picture,
    pose_triangles,
    save_gif,
    with_palette,
)
from pipeline.viewing.robot_figure import robot_figure

POSE_WIDTH = 1.05
"""Width of the place of a pose [m]."""

TIME_HEIGHT, HEADROOM = 0.22, 0.12
"""Height of the line of times below a row, and space above the head [m]."""

HUMAN_HEIGHT = 1.80
"""Height of a row with a human [m]; the row of a robot depends on its default height."""

PALETTE = 96
"""Colours of the picture."""

ROBOT_HEIGHT_SHARE = 1.85
"""Ratio of the height of a standing robot to that of its root link; T1: 1.23 m / 0.68 m."""


LARGE = 105.0
"""Dots per metre of a sheet of one clip."""


def contact_sheet(clips: Sequence[Shown], robot: Robot | None, poses: int = 8, dots_per_m: float = 70.0) -> bytes:
    """PNG with one row of poses per clip, below its name and note.

    Args:
        clips: clips from top to bottom
        robot: robot of the robot clips; None without robot clips
        poses: number of poses from the first frame to the last
        dots_per_m: scale [dots/m]
    """
    drawn = _Drawing(poses * POSE_WIDTH, dots_per_m)
    for shown in clips:
        drawn.add_clip(shown, robot, poses)
    return drawn.png()


class _Drawing:
    """Collects triangles and texts from the top down. `low` is the current lower end [m]."""

    def __init__(self, width: float, dots_per_m: float) -> None:
        self.width, self.dots_per_m = width, dots_per_m
        self.layers: list[Triangles] = []
        self.texts: list[Text] = []
        self.low = 0.0

    def add_clip(self, shown: Shown, robot: Robot | None, poses: int) -> None:
        rows = dataclasses.replace(shown, robot=robot).figures()
        duration_s = max((figure.duration_s for figure in rows), default=0.0)
        times_s = np.linspace(0.0, duration_s, poses) if poses > 1 else np.zeros(1)
        self._add_line(f"{shown.name}, {duration_s:.1f} s", 8.0, "#000000")
        for line in textwrap.wrap(shown.note, self._room(6.5), max_lines=2, placeholder=" …"):
            self._add_line(line, 6.5, "#8c2d04")
        for figure in rows:
            height = HUMAN_HEIGHT
            if figure.name != "human" and robot is not None:
                height = ROBOT_HEIGHT_SHARE * robot.default_root_height
            self.low -= height + HEADROOM
            self.texts.append((0.06, self.low + height - 0.06, figure.name, {"fontsize": 7, "color": "#777777"}))
            for index, time_s in enumerate(times_s):
                self._add_pose(figure, float(time_s), (index + 0.5) * POSE_WIDTH)
            self.low -= TIME_HEIGHT
        for index, time_s in enumerate(times_s):
            place = ((index + 0.5) * POSE_WIDTH, self.low + 0.02)
            self.texts.append((*place, f"{time_s:.2f} s", {"fontsize": 6.5, "ha": "center", "color": "#555555"}))
        self.low -= 0.06

    def _room(self, points: float) -> int:
        """Number of characters of a size [pt] per line; the mean width of a character is 0.6 of its size."""
        return max(20, int(self.width * self.dots_per_m / (0.6 * points * DPI / 72)))

    def _add_line(self, text: str, points: float, color: str) -> None:
        """A line of text across the picture, cut at its end."""
        room = self._room(points)
        self.low -= 1.6 * points * DPI / 72 / self.dots_per_m
        shown = text if len(text) <= room else f"{text[: room - 1]}…"
        self.texts.append((0.06, self.low, shown, {"fontsize": points, "color": color}))

    def _add_pose(self, figure: Figure, time_s: float, across: float) -> None:
        frame = figure.frame_at(time_s)
        shift = np.array([across, self.low])
        pose = pose_triangles(figure, frame, figure.first_heading)
        if pose.count == 0:
            self.texts.append((across, self.low + 0.5, "missing", {"fontsize": 7, "ha": "center", "color": CONTACT}))
        self.layers += [ground_triangles(0.36).moved(shift), pose.moved(shift)]

    def png(self) -> bytes:
        """The picture so far."""
        height = max(-self.low, 0.3)
        dots = (self.width * self.dots_per_m, height * self.dots_per_m)
        texts = [(x, y, text, {"va": "bottom", **style}) for x, y, text, style in self.texts]
        shown = picture(dots, (0.0, self.width), (-height, 0.0), self.layers, texts)
        stream = io.BytesIO()
        with_palette(shown, PALETTE).save(stream, "png")
        return stream.getvalue()


def entry_clip(store: Store, entry: Entry) -> Clip:
    """The clip, cut to its window if the blob is the whole recording (`start_frame`, `stop_frame`)."""
    clip = store.get_clip(entry.blob, entry.clip)
    start, stop = entry.numbers.get("start_frame"), entry.numbers.get("stop_frame")
    if not isinstance(clip, HumanClip) or start is None or stop is None or stop - start >= clip.frame_count:
        return clip
    return clip.cut(int(start), int(stop), clip.name)


LEAST_LOST_S = 0.1
"""Smallest loss that is shown [s]; smaller ones come from rounding to frames."""


def worst_clips(stage: Manifest, previous: Manifest, store: Store, robot: Robot | None, most: int = 5) -> bytes:
    """PNG of the input clips that lost the most seconds in a stage, with the first reason.

    One clip of each family (`walk@0-99`, `walk@0-99~mirror`, …) is shown, so that variants don't fill the sheet.

    Args:
        stage: manifest of the stage
        previous: manifest of the stage before it, which has the clips
        store: the store with the clips
        robot: the robot of the clips; None for human clips
        most: maximum number of clips
    """
    there = {clip for (clip,) in previous.kept("clip")}
    found = stage.findings("clip", "seconds_in", "seconds_out")
    lost = [(_number(before) - _number(after), clip) for clip, before, after in found]
    families: dict[str, str] = {}
    for seconds, clip in sorted(lost, key=lambda each: (-each[0], each[1])):
        if seconds > LEAST_LOST_S and clip in there:
            families.setdefault(clip.split("~")[0], clip)
    shown = list(families.values())[:most]
    entries = {entry.clip: entry for entry in rows_of(previous.entry_shards, shown)}
    rows = {row.clip: row for row in rows_of(stage.judged_shards, shown)}
    strips = []
    for row in (rows[clip] for clip in shown):
        clip = entry_clip(store, entries[row.clip])
        why = next((reason["text"] for reason in row.reasons if reason["effect"] == "rejected"), "")
        strips.append(
            Shown(
                name=row.clip,
                note=why,
                human=clip if isinstance(clip, HumanClip) else None,
                robot_clip=clip if isinstance(clip, RobotClip) else None,
            )
        )
    return contact_sheet(strips, robot)


def _number(value: Any) -> float:
    return float(value) if isinstance(value, (int, float)) else 0.0


GIF_COLOURS = 32
GIF_DOTS_PER_M = 130
GIF_FPS = 12.5


def walk_gif(clip: RobotClip, robot: Robot, start_s: float) -> bytes:
    """GIF of two seconds of a clip from `start_s` on, in real time; the same clip gives the same bytes."""
    figure = robot_figure(clip, robot)
    stop_s = min(start_s + 2.0, figure.duration_s)
    frames = [figure.frame_at(float(time_s)) for time_s in np.arange(start_s, stop_s, 1.0 / GIF_FPS)] or [0]
    height = ROBOT_HEIGHT_SHARE * robot.default_root_height + 0.1
    heading = float(figure.heading[frames[0]])
    dots = (1.2 * POSE_WIDTH * GIF_DOTS_PER_M, height * GIF_DOTS_PER_M)
    across, up = (-0.6 * POSE_WIDTH, 0.6 * POSE_WIDTH), (-0.12, height - 0.12)
    ground = ground_triangles(0.45)
    pictures = [picture(dots, across, up, [ground, pose_triangles(figure, frame, heading)]) for frame in frames]
    stream = io.BytesIO()
    save_gif(stream, pictures, GIF_FPS, GIF_COLOURS)
    return stream.getvalue()
