"""The browser viewer: human and robot side by side, with a clock and controls; `Viewer.step` is one tick of it."""

from dataclasses import dataclass

import numpy as np
import viser
from jaxtyping import Float

from pipeline import time_series
from pipeline.errors import PipelineError
from pipeline.files.shown_text import escaped
from pipeline.viewing.figure import Color, Figure, Shape
from pipeline.viewing.page_server import TickedPage, page_server
from pipeline.viewing.playlist import Playlist
from pipeline.viewing.projection import CONTACT
from pipeline.viewing.robot_figure import shape_mesh

SEGMENTS = 24
"""Corners of a circle."""

TILE = 0.25
"""Side of a square of the floor [m]."""

FLOOR_LENGTH, FLOOR_WIDTH = 4.0, 1.0
"""Size of the floor of a figure along x and y [m]; adjacent floors do not touch."""

PATH_CUTOFF_HZ = 0.4
"""Cutoff of the low-pass filter on the followed path [Hz], below any stride rate."""


class SceneFigure:
    """A figure in a scene, with its own floor, beside the others."""

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
        """Show the frame at a time. With `follow`, the figure stays in place and the floor moves."""
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
        """Remove the figure and its children from the scene."""
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
    """Add a primitive as a child of a part's node and return its mesh."""
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


SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0)
"""Playing speeds relative to real time."""


@dataclass
class Playback:
    """Playback state of a clip."""

    duration_s: float
    """Time of the last frame [s]."""
    time_s: float = 0.0
    speed: float = 1.0
    playing: bool = True

    def advance(self, passed_s: float) -> None:
        """Advance by real time, looping at the end."""
        if self.playing and self.duration_s > 0.0:
            self.time_s = (self.time_s + self.speed * passed_s) % self.duration_s

    def seek(self, time_s: float) -> None:
        """Jump to a time, clamped to the clip."""
        self.time_s = min(max(time_s, 0.0), self.duration_s)


NO_MARK = "–"
"""Entry of the list of marks that does not change the time."""

APART = 1.3
"""Distance of the two figures [m]."""


class Viewer(TickedPage):
    """A server with one scene that plays a list of clips.

    The server only answers this machine unless `host` is another address. If `port` is in use, the next free one is
    taken (`url`).
    """

    def __init__(self, playlist: Playlist, port: int, host: str = "127.0.0.1"):
        names = playlist.names + playlist.beside
        self._load = playlist.load
        self.server = page_server(host, port, label="Booster Lab")
        self.figures: list[SceneFigure] = []
        self.playback = Playback(duration_s=0.0)
        gui = self.server.gui
        self.clip = gui.add_dropdown("clip", options=tuple(names), initial_value=names[0], visible=len(names) > 1)
        self.play = gui.add_button("pause")
        self.slider = gui.add_slider("time [s]", min=0.0, max=1.0, step=0.01, initial_value=0.0)
        self.speed = gui.add_dropdown("speed", options=tuple(f"{speed:g}" for speed in SPEEDS), initial_value="1")
        self.follow = gui.add_checkbox("follow the figures", initial_value=True)
        self.marks = gui.add_dropdown("go to", options=(NO_MARK,), initial_value=NO_MARK, visible=False)
        self.line = gui.add_markdown("", visible=False)
        self.text = gui.add_markdown("")
        self.play.on_click(lambda _: self.toggle())
        self._chosen = ""
        self._mark, self._times = NO_MARK, {}
        self._slider_set_to = 0.0
        self._choose(names[0])

    def toggle(self) -> None:
        """Pause or play."""
        self.playback.playing = not self.playback.playing
        self.play.label = "pause" if self.playback.playing else "play"

    def step(self, passed_s: float) -> None:
        """One tick: read the controls, advance by `passed_s` of real time, move the figures."""
        if self.clip.value != self._chosen:
            self._try_to_choose(self.clip.value)
        self.playback.speed = float(self.speed.value)
        if self.marks.value != self._mark:
            self._mark = self.marks.value
            self.playback.seek(self._times.get(self._mark, self.playback.time_s))
            self._slider_set_to = self.slider.value = min(round(self.playback.time_s, 2), self.slider.max)
        if abs(self.slider.value - self._slider_set_to) > 1e-6:
            self.playback.seek(self.slider.value)
        else:
            self.playback.advance(passed_s)
        self._show()

    def _try_to_choose(self, name: str) -> None:
        """Show another clip; if it can't be shown, keep the scene and display the reason."""
        try:
            self._choose(name)
        except PipelineError as error:
            self._chosen = name
            self.text.content = f"**{escaped(name)}** can't be shown: {escaped(error)}"

    def _choose(self, name: str) -> None:
        shown = self._load(name)
        figures = shown.figures()
        with self.server.atomic():
            for old in self.figures:
                old.remove()
            middle = (len(figures) - 1) / 2
            places = [np.array([0.0, APART * (middle - index), 0.0]) for index in range(len(figures))]
            self.figures = [
                SceneFigure(self.server.scene, figure, place) for figure, place in zip(figures, places, strict=True)
            ]
        duration_s = max((figure.duration_s for figure in figures), default=0.0)
        self.playback = Playback(duration_s=duration_s, playing=self.playback.playing)
        self.slider.max = max(round(duration_s, 2), 0.01)
        self.text.content = f"**{escaped(name)}**\n\n{shown.text}"
        self._times = dict(shown.marks)
        self.marks.options, self.marks.value = (NO_MARK, *self._times), NO_MARK
        self.marks.visible, self.line.visible = bool(self._times), shown.line_at is not None
        self._mark, self._line_at = NO_MARK, shown.line_at
        self.server.initial_camera.position = (2.1, -2.5, 1.2)
        self.server.initial_camera.look_at = (0.0, 0.0, 0.7)
        self._chosen = name
        self._show()

    def _show(self) -> None:
        with self.server.atomic():
            for figure in self.figures:
                figure.show(self.playback.time_s, self.follow.value)
        self._slider_set_to = min(round(self.playback.time_s, 2), self.slider.max)
        self.slider.value = self._slider_set_to
        if self._line_at is not None:
            self.line.content = escaped(self._line_at(self.playback.time_s))
