"""A person who holds the robot by its trunk and lifts it off the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.simulation.plant import PlantState


@dataclass(frozen=True, kw_only=True)
class Hold:
    """Time span and motion of the hold."""

    start_s: float
    stop_s: float
    lift: float = 0.06
    """Height of the lift [m]."""
    rise_s: float = 0.6
    """Duration of the lift [s]."""
    tilt_rad: float = 0.0
    """Forward tilt while held [rad]."""


class HeldPlant(MujocoPlant):
    """The robot in MuJoCo with a hand on its trunk: spring and damper towards the hand's pose."""

    def __init__(self, robot: Robot, options: MujocoOptions, hold: Hold):
        self._hold = hold
        super().__init__(robot, options)

    def reset(self, state: PlantState | None = None) -> None:
        super().reset(state)
        self._grip: np.ndarray | None = None

    def step(self, torque: Float[np.ndarray, " j"], force_w: Float[np.ndarray, " 3"] | None = None) -> None:
        hold, now = self._hold, self.data.time
        self.data.xfrc_applied[1, 3:] = 0.0
        if hold.start_s <= now < hold.stop_s:
            hand, moment = self._hand(hold, now)
            force_w = hand if force_w is None else force_w + hand
            self.data.xfrc_applied[1, 3:] = moment
        super().step(torque, force_w)

    def _hand(self, hold: Hold, now: float) -> tuple[np.ndarray, np.ndarray]:
        """Force [N] and moment [N m] of the hand."""
        mass = float(self.model.body_subtreemass[1])
        if self._grip is None:
            self._grip = self.data.xipos[1].copy()
        part = min((now - hold.start_s) / hold.rise_s, 1.0)
        target = self._grip + np.array([0.0, 0.0, hold.lift * part])
        stiffness, damping = 60.0 * mass, 12.0 * mass
        force = stiffness * (target - self.data.xipos[1]) - damping * self.data.qvel[:3]
        force[2] += part * mass * 9.81
        up = self.data.xmat[1].reshape(3, 3)[:, 2]
        forward = self.data.xmat[1].reshape(3, 3)[:, 0] * np.array([1.0, 1.0, 0.0])
        forward /= max(float(np.linalg.norm(forward)), 1e-6)
        target_up = np.array([0.0, 0.0, np.cos(hold.tilt_rad * part)]) + np.sin(hold.tilt_rad * part) * forward
        moment = 120.0 * np.cross(up, target_up) - 12.0 * self.data.cvel[1, :3]
        return force, moment
