"""Webots' module `controller`, as far as our controller uses it, connected to a stand-in's process.

JSON lines are exchanged over a socket whose file descriptor is in the environment. As in Webots, sensors have values
after the first step that follows `enable`, and torques are limited to a motor's maximum.
"""

import json
import math
import os
import socket

SOCKET_VARIABLE = "BOOSTER_LAB_STAND_IN"


class Motor:
    def __init__(self, robot: "Robot", name: str, max_torque: float):
        self._robot, self._name, self._max_torque = robot, name, max_torque

    def setTorque(self, torque: float) -> None:
        self._robot._torque[self._name] = min(max(torque, -self._max_torque), self._max_torque)


class Sensor:
    """A position sensor, gyro, accelerometer or inertial unit."""

    def __init__(self, robot: "Robot", name: str):
        self._robot, self._name = robot, name

    def enable(self, samplingPeriod: int) -> None:
        if samplingPeriod <= 0:
            raise ValueError(f"the sampling period {samplingPeriod} of '{self._name}' is not above 0")
        self._robot._enabled[self._name] = samplingPeriod

    def getValue(self) -> float:
        return self._value(1)[0]

    def getValues(self) -> list[float]:
        return self._value(3)

    def getQuaternion(self) -> list[float]:
        """x, y, z, w"""
        return self._value(4)

    def _value(self, size: int) -> list[float]:
        return self._robot._values.get(self._name, [math.nan] * size)


class Node:
    """The robot's node, for a supervisor."""

    def __init__(self, robot: "Robot"):
        self._robot = robot

    def getPosition(self) -> list[float]:
        return self._robot._truth["position"]

    def getOrientation(self) -> list[float]:
        """Rows of the rotation matrix."""
        return self._robot._truth["orientation"]

    def getVelocity(self) -> list[float]:
        """Linear velocity of the centre of mass, then angular velocity, in the world."""
        return self._robot._truth["velocity"]


class Robot:
    """The robot that this process controls."""

    def __init__(self) -> None:
        self._stream = socket.socket(fileno=int(os.environ[SOCKET_VARIABLE])).makefile("rw", encoding="utf-8")
        hello = self._receive()
        self._step_ms: float = hello["timestep_ms"]
        self._truth: dict[str, list[float]] = hello["truth"]
        self._torque: dict[str, float] = {}
        self._enabled: dict[str, int] = {}
        self._values: dict[str, list[float]] = {}
        self._devices: dict[str, Motor | Sensor] = {name: Sensor(self, name) for name in hello["sensors"]}
        self._devices |= {name: Motor(self, name, torque) for name, torque in hello["motors"].items()}

    def getBasicTimeStep(self) -> float:
        return self._step_ms

    def getDevice(self, name: str) -> Motor | Sensor | None:
        if name not in self._devices:
            print(f"Error: the device '{name}' was not found.", flush=True)
        return self._devices.get(name)

    def step(self, duration: int) -> int:
        if duration <= 0 or duration % self._step_ms:
            raise ValueError(f"a step of {duration} ms is not a multiple of {self._step_ms:g} ms")
        self._send({"step": duration, "torque": self._torque, "enabled": self._enabled})
        answer = self._receive()
        if answer.get("end"):
            return -1
        self._truth = answer["truth"]
        self._values.update(answer["values"])
        return 0

    def _send(self, message: dict) -> None:
        self._stream.write(json.dumps(message) + "\n")
        self._stream.flush()

    def _receive(self) -> dict:
        line = self._stream.readline()
        return json.loads(line) if line else {"end": True}


class Supervisor(Robot):
    """A robot with access to the world."""

    def getSelf(self) -> Node:
        return Node(self)

    def simulationQuit(self, status: int) -> None:
        self._send({"quit": status})
