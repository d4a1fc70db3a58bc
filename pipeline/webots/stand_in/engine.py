"""Interface of a physics engine in the stand-in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.webots.scene_model import SceneModel


@dataclass(frozen=True, kw_only=True)
class RootMotion:
    """Motion of the robot's root frame in the world."""

    pos_w: Float[np.ndarray, " 3"]
    quat_w: Float[np.ndarray, " 4"]
    lin_vel_w: Float[np.ndarray, " 3"]
    """Velocity of its origin [m/s]."""
    ang_vel_w: Float[np.ndarray, " 3"]


@runtime_checkable
class Engine(Protocol):
    """A simulated scene, h hinges in the scene's order."""

    label: str
    """Name of the engine in results."""

    def step(self, torque: Float[np.ndarray, " h"]) -> None:
        """Advance by one basic timestep with hinge torques [N m]."""
        ...

    def joint_pos(self) -> Float[np.ndarray, " h"]:
        """Hinge positions [rad], zero as in the PROTO."""
        ...

    def root(self) -> RootMotion: ...


def start_poses(scene: SceneModel) -> tuple[Float[np.ndarray, "b 3"], Float[np.ndarray, "b 4"]]:
    """World positions [m] and orientations of all bodies at the start."""
    pos, quat = [], []
    for body in scene.bodies:
        if body.parent < 0:
            pos.append(body.pos)
            quat.append(body.quat)
        else:
            pos.append(pos[body.parent] + rotation.rotate(quat[body.parent], body.pos))
            quat.append(rotation.multiply(quat[body.parent], body.quat))
    return np.array(pos), np.array(quat)
