"""What the stand-in asks of a physics engine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.webots.scene_model import SceneModel


@dataclass(frozen=True, kw_only=True)
class RootMotion:
    """Of the robot's own frame, in the world."""

    pos_w: Float[np.ndarray, " 3"]
    quat_w: Float[np.ndarray, " 4"]
    lin_vel_w: Float[np.ndarray, " 3"]
    """Of its origin."""
    ang_vel_w: Float[np.ndarray, " 3"]


@runtime_checkable
class Engine(Protocol):
    """A scene that was built and is stepped. Hinges in the scene's order."""

    label: str
    """What results are said of."""

    def step(self, torque: Float[np.ndarray, " h"]) -> None:
        """One basic timestep with hinge torques [N m]."""
        ...

    def joint_pos(self) -> Float[np.ndarray, " h"]:
        """[rad], zero as the PROTO has it."""
        ...

    def root(self) -> RootMotion: ...


def start_poses(scene: SceneModel) -> tuple[Float[np.ndarray, "b 3"], Float[np.ndarray, "b 4"]]:
    """World positions and orientations of all bodies as the file has them."""
    pos, quat = [], []
    for body in scene.bodies:
        if body.parent < 0:
            pos.append(body.pos)
            quat.append(body.quat)
        else:
            pos.append(pos[body.parent] + rotation.rotate(quat[body.parent], body.pos))
            quat.append(rotation.multiply(quat[body.parent], body.quat))
    return np.array(pos), np.array(quat)
