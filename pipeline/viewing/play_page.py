"""Page of `booster-lab play`: sliders and keys for the command, pushes, terrain and friction of a simulated walk."""

import threading
from collections.abc import Callable
from typing import Any, Literal

import numpy as np

from pipeline.files.shown_text import escaped
from pipeline.robot import Kinematics
from pipeline.validation.deployed import Deployed
from pipeline.viewing.live_walk import TERRAINS, LiveWalk, surface
from pipeline.viewing.page_server import TickedPage, page_server
from pipeline.viewing.robot_figure import robot_parts
from pipeline.viewing.viewer import add_shape

LIMITS = ((-0.6, 2.0), (-0.6, 0.6), (-1.5, 1.5))
"""Ranges of the sliders: forward, lateral [m/s], yaw rate [rad/s], equal to the training ranges."""
Key = Literal["W", "S", "A", "D", "Q", "E", "X", "P", "R"]
KEYS: dict[Key, tuple[int, float, str]] = {
    "W": (0, 0.1, "forward faster"),
    "S": (0, -0.1, "forward slower"),
    "A": (1, 0.1, "to the left"),
    "D": (1, -0.1, "to the right"),
    "Q": (2, 0.1, "turn left"),
    "E": (2, -0.1, "turn right"),
}
"""Key -> index in the command, step [m/s, rad/s], and label."""
DIRECTIONS = {"forward": 0.0, "backward": np.pi, "left": np.pi / 2.0, "right": -np.pi / 2.0}
MOST_STEPS = 10
"""Maximum control steps per tick: a slow machine runs slower than real time instead of accumulating a delay."""
GROUND_M = ((-2.0, 12.0), (-3.0, 3.0))
GROUND_STEP_M = 0.1


class PlayPage(TickedPage):
    """A server with the scene and its controls."""

    def __init__(self, one: Deployed, name: str, port: int) -> None:
        self.walk = LiveWalk(one)
        self._lock = threading.Lock()
        self._kinematics = Kinematics(one.robot)
        self._links = [one.robot.link(part.name) for part in robot_parts(one.robot)]
        self.server = page_server("127.0.0.1", port, label=f"Booster Lab: {name}")
        self._owed_s = 0.0
        self._add_scene()
        self._add_controls(name)
        self._show()

    def step(self, passed_s: float) -> None:
        """One tick: read the controls, simulate `passed_s` of real time, move the robot."""
        self.walk.goal = np.array([slider.value for slider in self.sliders])
        place = (self.terrain.value, round(float(self.friction.value), 2))
        with self._lock:
            if place != self._placed:
                self.walk.place(*place)
                self._placed = place
                self._show_ground()
            self._owed_s = min(self._owed_s + passed_s, MOST_STEPS * self.walk.control_s)
            while self._owed_s >= self.walk.control_s - 1e-9 and not self.paused.value:
                self.walk.step()
                self._owed_s -= self.walk.control_s
                if self.walk.fallen and self.stand_up.value:
                    self.walk.restart()
        self._show()

    def press(self, key: Key) -> None:
        """Change the command by a key of `KEYS`."""
        part, step, _ = KEYS[key]
        low, high = LIMITS[part]
        self.sliders[part].value = round(float(np.clip(self.sliders[part].value + step, low, high)), 2)

    def halt(self) -> None:
        """Command zero velocity."""
        for slider in self.sliders:
            slider.value = 0.0

    def push(self) -> None:
        """Push with the chosen impulse and direction."""
        with self._lock:
            self.walk.push(float(self.impulse.value), DIRECTIONS[self.direction.value])

    def restart(self) -> None:
        """Restart the walk."""
        with self._lock:
            self.walk.restart()

    def _add_scene(self) -> None:
        robot = self.walk.one.robot
        self._parts = []
        for part in robot_parts(robot):
            self._parts.append(self.server.scene.add_frame(f"/robot/{part.name}", show_axes=False))
            for index, shape in enumerate(part.shapes):
                add_shape(self.server.scene, f"/robot/{part.name}", index, shape)
        self._show_ground()
        self.server.initial_camera.position = (2.2, -2.6, 1.4)
        self.server.initial_camera.look_at = (0.0, 0.0, 0.6)

    def _add_controls(self, name: str) -> None:
        gui = self.server.gui
        self.text = gui.add_markdown("")
        names = ("forward [m/s]  W S", "left [m/s]  A D", "turn left [rad/s]  Q E")
        self.sliders = [
            gui.add_slider(label, min=low, max=high, step=0.01, initial_value=0.0)
            for label, (low, high) in zip(names, LIMITS, strict=True)
        ]
        halt = gui.add_button("stand (X)")
        with gui.add_folder("push"):
            self.impulse = gui.add_slider("impulse [N s]", min=1.0, max=40.0, step=1.0, initial_value=10.0)
            self.direction = gui.add_dropdown("to", options=tuple(DIRECTIONS), initial_value="left")
            push = gui.add_button("push (P)")
        with gui.add_folder("world"):
            self.terrain = gui.add_dropdown("terrain", options=tuple(TERRAINS), initial_value="flat")
            self.friction = gui.add_slider("friction", min=0.1, max=1.5, step=0.05, initial_value=1.0)
        self.paused = gui.add_checkbox("pause", initial_value=False)
        self.follow = gui.add_checkbox("follow the robot", initial_value=True)
        self.stand_up = gui.add_checkbox("restart after a fall", initial_value=True)
        restart = gui.add_button("restart (R)")
        self._placed = (self.terrain.value, round(float(self.friction.value), 2))
        self._name = name
        actions: dict[Key, tuple[Any, Callable[[], None]]] = {
            "X": (halt, self.halt),
            "P": (push, self.push),
            "R": (restart, self.restart),
        }
        for key, (button, act) in actions.items():
            button.on_click(lambda _, act=act: act())
            gui.add_command(str(button.label), hotkey=key).on_trigger(lambda _, act=act: act())
        for key, (_, _, what) in KEYS.items():
            gui.add_command(f"{what} ({key})", hotkey=key).on_trigger(lambda _, key=key: self.press(key))

    def _show_ground(self) -> None:
        vertices, faces = surface(self.walk.ground, *GROUND_M, GROUND_STEP_M)
        self._ground = self.server.scene.add_mesh_simple(
            "/ground", vertices=vertices.astype(np.float32), faces=faces.astype(np.uint32), color=(222, 222, 214)
        )
        self._wires = self.server.scene.add_mesh_simple(
            "/ground/wires",
            vertices=(vertices + np.array([0.0, 0.0, 0.002])).astype(np.float32),
            faces=faces.astype(np.uint32),
            color=(190, 190, 184),
            wireframe=True,
        )

    def _show(self) -> None:
        state = self.walk.state
        poses = self._kinematics.forward(state.root_pos_w[None], state.root_quat_w[None], state.joint_pos[None])
        shift = state.root_pos_w * np.array([1.0, 1.0, 0.0]) if self.follow.value else np.zeros(3)
        with self.server.atomic():
            self._ground.position = -shift
            for part, link in zip(self._parts, self._links, strict=True):
                part.position = poses.pos_w[0, link] - shift
                part.wxyz = poses.quat_w[0, link]
        self.text.content = self._text()

    def _text(self) -> str:
        forward, lateral, yaw = self.walk.command
        state = "**fallen**" if self.walk.fallen else "walking"
        return (
            f"**{escaped(self._name)}**, {state}, {self.walk.time_s:.1f} s\n\n"
            f"command {forward:.2f} m/s, {lateral:.2f} m/s, {yaw:.2f} rad/s"
        )
