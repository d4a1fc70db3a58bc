"""Simulated readings of the robot's sensors."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from pipeline import rotation
from pipeline.deployment.controller import Reading
from pipeline.simulation.plant import PlantState

DOWN_W = np.array([0.0, 0.0, -1.0])


@runtime_checkable
class Sensors(Protocol):
    """Interface of sensors, read once per control step in temporal order."""

    def read(self, state: PlantState) -> Reading: ...


class PerfectSensors:
    """Exact readings."""

    def read(self, state: PlantState) -> Reading:
        return Reading(
            gyro_b=state.root_ang_vel_b,
            gravity_b=rotation.rotate_inverse(state.root_quat_w, DOWN_W),
            joint_pos=state.joint_pos,
            joint_vel=state.joint_vel,
        )


@dataclass(frozen=True, kw_only=True)
class SensorNoise:
    """Half widths of uniform noise, sampled for each value and control step. Angles in rad, speeds in rad/s."""

    gyro: float
    gravity: float
    """Noise of each component of the gravity unit vector."""
    joint_pos: float
    joint_vel: float
    """[rad/s]"""


class NoisySensors:
    """Uniform noise added to the readings of other sensors; default: exact ones."""

    def __init__(self, noise: SensorNoise, rng: np.random.Generator, of: Sensors | None = None):
        self.noise, self.rng, self.of = noise, rng, of or PerfectSensors()

    def read(self, state: PlantState) -> Reading:
        true = self.of.read(state)

        def noisy(value: np.ndarray, width: float) -> np.ndarray:
            return value + self.rng.uniform(-width, width, value.shape)

        return Reading(
            gyro_b=noisy(true.gyro_b, self.noise.gyro),
            gravity_b=noisy(true.gravity_b, self.noise.gravity),
            joint_pos=noisy(true.joint_pos, self.noise.joint_pos),
            joint_vel=noisy(true.joint_vel, self.noise.joint_vel),
        )
