"""How deep a robot's parts are inside each other, in MuJoCo's collision shapes."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot, mujoco_model


@dataclass(frozen=True, kw_only=True)
class SelfCollision:
    """The deepest overlap of each frame."""

    depth: Float[np.ndarray, " t"]
    """[m], 0 where nothing overlaps."""
    pairs: tuple[tuple[str, str] | None, ...]
    """Names of the two shapes that overlap most; None where none do."""


def self_collision(clip: RobotClip, robot: Robot) -> SelfCollision:
    """Overlap of shapes of links that are not parent and child; the ground is not looked at."""
    model = mujoco_model(robot)
    data = mujoco.MjData(model)
    depth = np.zeros(clip.frame_count)
    pairs: list[tuple[str, str] | None] = [None] * clip.frame_count
    for frame in range(clip.frame_count):
        data.qpos[:3], data.qpos[3:7] = clip.root_pos_w[frame], clip.root_quat_w[frame]
        data.qpos[7:] = clip.joint_pos[frame]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        if data.ncon:
            worst = int(np.argmin(data.contact.dist))
            depth[frame] = max(-float(data.contact.dist[worst]), 0.0)
            shapes = data.contact.geom[worst]
            pairs[frame] = (model.geom(shapes[0]).name, model.geom(shapes[1]).name)
    return SelfCollision(depth=depth, pairs=tuple(pairs))
