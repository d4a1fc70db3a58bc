"""Films (MP4 or GIF) of figures side by side, or of a policy in MuJoCo; they need no display."""

import os
import tempfile
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import imageio_ffmpeg
import numpy as np

from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import FileError, PipelineError, UnknownNameError
from pipeline.validation.deployed import Deployed
from pipeline.viewing.figure import Figure
from pipeline.viewing.live_walk import TERRAINS, LiveWalk
from pipeline.viewing.projection import Text, Triangles, ground_triangles, picture, pose_triangles, save_gif
from pipeline.viewing.robot_figure import robot_figure

SUFFIXES = (".mp4", ".gif")
DOTS_PER_M = 190
WIDTH_M, HEIGHT_M = 1.2, 2.0
"""Size of the place of a figure [m]."""
LETTERS = 30
"""Maximum number of characters per line above a figure."""
FPS = {".mp4": 25, ".gif": 10}
PALETTE = 64


def write_film(
    path: Path, figures: Sequence[Figure], *, start_s: float = 0.0, seconds: float | None = None, text: str = ""
) -> int:
    """Write a film of figures with a common clock and return its number of frames. The file is written atomically.

    Args:
        path: `.mp4` or `.gif`
        figures: from left to right
        start_s: time at which the film begins [s]
        seconds: length of the film [s]; None: to the end of the longest figure
        text: text at the lower edge

    Raises FileError for another suffix and if the file can't be written, PipelineError for a start beyond the figures.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise FileError(path, f"a film is one of: {', '.join(SUFFIXES)}.", "Name a file with that suffix.")
    fps = FPS[path.suffix.lower()]
    end_s = max(figure.duration_s for figure in figures)
    if not 0.0 <= start_s <= end_s:
        raise PipelineError(f"a film can't start at {start_s:g} s; 0 to {end_s:.2f} s is allowed.")
    stop_s = end_s if seconds is None else min(start_s + seconds, end_s)
    times_s = np.arange(start_s, max(stop_s, start_s + 1.0 / fps), 1.0 / fps)
    pictures = (_picture(figures, float(time_s), text) for time_s in times_s)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, aside = tempfile.mkstemp(prefix=f".{path.stem}.", suffix=path.suffix.lower(), dir=path.parent)
    os.close(handle)
    try:
        if path.suffix.lower() == ".gif":
            save_gif(Path(aside), pictures, fps, PALETTE)
        else:
            _write_mp4(Path(aside), pictures, fps)
        Path(aside).chmod(0o644)
        Path(aside).replace(path)
    except OSError as error:
        raise FileError(path, f"could not be written ({error}).") from error
    finally:
        Path(aside).unlink(missing_ok=True)
    return len(times_s)


def _picture(figures: Sequence[Figure], time_s: float, text: str) -> np.ndarray:
    """RGB picture (h, w, 3), with even sides, as H.264 requires."""
    layers: list[Triangles] = []
    texts: list[Text] = []
    style = {"fontsize": 8, "ha": "center", "color": "#555555"}
    for place, figure in enumerate(figures):
        across = (place + 0.5) * WIDTH_M
        pose = pose_triangles(figure, figure.frame_at(time_s), figure.first_heading)
        layers += [each.moved(np.array([across, 0.0])) for each in (ground_triangles(0.45), pose)]
        texts.append((across, -0.2, figure.name, style))
    lines = textwrap.fill(f"{time_s:.2f} s  {text}", LETTERS * len(figures))
    texts.append((0.03, HEIGHT_M - 0.3, lines, {**style, "ha": "left", "va": "top"}))
    width_m = WIDTH_M * len(figures)
    width, height = (2 * round(size * DOTS_PER_M / 2) for size in (width_m, HEIGHT_M))
    return picture((width, height), (0.0, width_m), (-0.25, HEIGHT_M - 0.25), layers, texts)


def _write_mp4(path: Path, pictures: Iterator[np.ndarray], fps: int) -> None:
    writer = None
    for each in pictures:
        if writer is None:
            size = (each.shape[1], each.shape[0])
            writer = imageio_ffmpeg.write_frames(str(path), size, fps=fps, macro_block_size=2, quality=7)
            writer.send(None)
        writer.send(each)
    if writer is not None:
        writer.close()


LONGEST_S = 120.0


@dataclass(frozen=True, kw_only=True)
class Walk:
    """The walk to film."""

    command: tuple[float, float, float]
    """Forward and left velocity [m/s], yaw rate [rad/s]."""
    seconds: float
    push: float | None = None
    """Impulse of a push to the left at half time [N s]; None: no push."""
    terrain: str = "flat"
    friction: float = 1.0


def record_walk(path: Path, one: Deployed, walk: Walk) -> str:
    """Write the film of a walk; return a summary. Raises UnknownNameError, FileError."""
    record, fell_s = simulated(one, walk)
    forward, lateral, yaw = walk.command
    text = f"command {forward:g} m/s, {lateral:g} m/s, {yaw:g} rad/s, {walk.terrain}"
    count = write_film(path, [robot_figure(record, one.robot)], text=text)
    end = f"; it fell at {fell_s:.2f} s" if fell_s is not None else ""
    return f"{path}: {count} pictures, {record.duration_s:.1f} s, {text}{end}"


def simulated(one: Deployed, walk: Walk) -> tuple[RobotClip, float | None]:
    """The walk at the control rate, and the time of a fall [s]; None without a fall."""
    if walk.terrain not in TERRAINS:
        raise UnknownNameError("terrain", walk.terrain, list(TERRAINS))
    if not 0.0 < walk.seconds <= LONGEST_S:
        raise PipelineError(
            f"a walk of {walk.seconds:g} s can't be filmed; more than 0, up to {LONGEST_S:g} s is allowed."
        )
    live = LiveWalk(one, walk.terrain, walk.friction)
    live.goal = np.array(walk.command)
    fell_s = None
    steps = max(round(walk.seconds / live.control_s), 2)
    for step in range(steps):
        if walk.push is not None and step == steps // 2:
            live.push(walk.push, np.pi / 2.0)
        live.step()
        if live.fallen and fell_s is None:
            fell_s = live.time_s
    return live.record(), fell_s
