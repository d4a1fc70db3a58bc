"""Simulate a world in an engine while its controller, a separate process as in Webots, commands the torques."""

import json
import os
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import rotation
from pipeline.errors import FileError
from pipeline.webots.scene_model import SceneModel, read_scene
from pipeline.webots.stand_in.mujoco_engine import MujocoEngine, RootMotion
from pipeline.webots.stand_in.ode_engine import OdeEngine

API = Path(__file__).resolve().parent / "api"
"""Folder of the module `controller`."""
SOCKET_VARIABLE = "BOOSTER_LAB_STAND_IN"
GRACE_S = 5.0
"""Time that a controller may take to end after the simulation [s]."""


class Simulation:
    """An engine with the devices of a scene."""

    def __init__(self, scene: SceneModel, engine: MujocoEngine | OdeEngine):
        self.scene, self.engine = scene, engine
        self.motors = {hinge.motor: index for index, (_, hinge) in enumerate(scene.hinges)}
        self.sensors = {hinge.sensor: index for index, (_, hinge) in enumerate(scene.hinges)}
        self.steps = 0
        self.last = self.root = engine.root()

    @property
    def time_s(self) -> float:
        return self.steps * self.scene.timestep_ms / 1000.0

    def hello(self) -> dict[str, Any]:
        """First message to a controller: devices, timestep, supervisor state."""
        motors = {hinge.motor: hinge.max_torque for _, hinge in self.scene.hinges}
        sensors = [*self.sensors, *self.scene.imu]
        return {"timestep_ms": self.scene.timestep_ms, "motors": motors, "sensors": sensors, "truth": self.truth()}

    def step(self, message: dict[str, Any]) -> dict[str, Any]:
        """Advance by the requested time and return the sensor values."""
        torque = np.zeros(len(self.motors))
        for name, value in message["torque"].items():
            torque[self.motors[name]] = value
        for _ in range(round(message["step"] / self.scene.timestep_ms)):
            self.last = self.root
            self.engine.step(torque)
            self.root, self.steps = self.engine.root(), self.steps + 1
        return {"truth": self.truth(), "values": self.values(message["enabled"])}

    def truth(self) -> dict[str, list[float]]:
        """Supervisor state: pose of the origin and, as in Webots, velocity of the centre of mass."""
        root = self.root
        com_vel_w = _velocity_at(self.scene.bodies[0].com, root)
        return {
            "position": root.pos_w.tolist(),
            "orientation": rotation.to_matrix(root.quat_w).ravel().tolist(),
            "velocity": [*com_vel_w.tolist(), *root.ang_vel_w.tolist()],
        }

    def values(self, enabled: dict[str, int]) -> dict[str, list[float]]:
        """Values of the sensors that are enabled and due."""
        joint_pos = self.engine.joint_pos()
        found = {}
        for name, period in enabled.items():
            if round(self.time_s * 1000.0) % period:
                continue
            if name in self.sensors:
                found[name] = [float(joint_pos[self.sensors[name]])]
            else:
                kind, place = self.scene.imu[name]
                found[name] = _imu(kind, place, self.root, self.last, self.scene)
        return found


def _imu(kind: str, place: np.ndarray, now: RootMotion, before: RootMotion, scene: SceneModel) -> list[float]:
    if kind == "Gyro":
        return rotation.rotate_inverse(now.quat_w, now.ang_vel_w).tolist()
    if kind == "InertialUnit":
        return np.roll(now.quat_w, -1).tolist()
    change = _velocity_at(place, now) - _velocity_at(place, before)
    force = change / (scene.timestep_ms / 1000.0) + np.array([0.0, 0.0, scene.gravity])
    return rotation.rotate_inverse(now.quat_w, force).tolist()


def _velocity_at(place: np.ndarray, root: RootMotion) -> np.ndarray:
    """World velocity of a point given in the root's frame."""
    return root.lin_vel_w + np.cross(root.ang_vel_w, rotation.rotate(root.quat_w, place))


def serve(world: Path, engine: str) -> int:
    """Run a world in `mujoco` or `ode` until its controller ends it; the exit status. Raises PipelineError."""
    world = world.resolve()  # the controller has another working directory
    scene = read_scene(world)
    simulation = Simulation(scene, OdeEngine(scene) if engine == "ode" else MujocoEngine(scene))
    program = world.parent.parent / "controllers" / scene.controller / f"{scene.controller}.py"
    if not program.is_file():
        raise FileError(program, "the controller that the world names is missing.")
    ours, theirs = socket.socketpair()
    environment = {**os.environ, SOCKET_VARIABLE: str(theirs.fileno()), "PYTHONPATH": str(API)}
    process = subprocess.Popen(
        [sys.executable, str(program)], cwd=program.parent, env=environment, pass_fds=[theirs.fileno()]
    )
    theirs.close()
    try:
        status = _talk(simulation, ours)
    except (BrokenPipeError, ConnectionResetError):
        status = 0  # the controller's exit status is more informative
    try:
        return process.wait(GRACE_S) or status
    except subprocess.TimeoutExpired:
        process.kill()
        return 1


def _talk(simulation: Simulation, ours: socket.socket) -> int:
    """Answer the controller until it quits or disconnects."""
    with ours, ours.makefile("rw", encoding="utf-8") as stream:
        answer = simulation.hello()
        while True:
            stream.write(json.dumps(answer) + "\n")
            stream.flush()
            message = json.loads(stream.readline() or '{"quit": 0}')
            if "quit" in message:
                return int(message["quit"])
            answer = simulation.step(message)
