"""The browser viewer: the human and the robot side by side, with a clock and controls.

`Viewer.step` does all the work of one tick, so that a test can drive it without a browser.
"""

from __future__ import annotations

import time
from typing import NoReturn

import numpy as np

from pipeline.errors import PipelineError
from pipeline.files.shown_text import escaped
from pipeline.viewing.page_server import page_server
from pipeline.viewing.playback import SPEEDS, Playback
from pipeline.viewing.playlist import Playlist
from pipeline.viewing.scene import SceneFigure

TICK_S = 1.0 / 30.0
"""Time between two pictures [s]."""

NO_MARK = "–"
"""Entry of the list of marks that leaves the time as it is."""

APART = 1.3
"""Distance of the two figures [m]."""


class Viewer:
    """A server with one scene that plays a list of clips.

    The server is reached from this machine alone unless `host` says otherwise; when `port` is taken, the next free
    one is used (`url`).
    """

    def __init__(self, playlist: Playlist, port: int, host: str = "127.0.0.1"):
        names = playlist.names + playlist.beside
        self._load = playlist.load
        self.server = page_server(host, port, label="Booster Lab")
        self.server.gui.configure_theme(show_logo=False, show_share_button=False)
        self.figures: list[SceneFigure] = []
        self.playback = Playback(duration_s=0.0)
        gui = self.server.gui
        self.clip = gui.add_dropdown("clip", options=tuple(names), initial_value=names[0], visible=len(names) > 1)
        self.play = gui.add_button("pause")
        self.slider = gui.add_slider("time [s]", min=0.0, max=1.0, step=0.01, initial_value=0.0)
        self.speed = gui.add_dropdown("speed", options=tuple(f"{speed:g}" for speed in SPEEDS), initial_value="1")
        self.follow = gui.add_checkbox("stay in place", initial_value=True)
        self.marks = gui.add_dropdown("go to", options=(NO_MARK,), initial_value=NO_MARK, visible=False)
        self.line = gui.add_markdown("", visible=False)
        self.text = gui.add_markdown("")
        self.play.on_click(lambda _: self.toggle())
        self._chosen = ""
        self._mark, self._times = NO_MARK, {}
        self._slider_set_to = 0.0
        self._choose(names[0])

    @property
    def url(self) -> str:
        host = self.server.get_host()
        return f"http://{'localhost' if host in ('0.0.0.0', '127.0.0.1') else host}:{self.server.get_port()}"

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

    def run(self) -> NoReturn:
        """Play until interrupted."""
        last = time.monotonic()
        while True:
            time.sleep(TICK_S)
            now = time.monotonic()
            self.step(now - last)
            last = now

    def stop(self) -> None:
        """End the server; its port is free again."""
        self.server.stop()

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
        self._times = {mark.label: mark.time_s for mark in shown.marks}
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
