"""How deep a robot's parts are inside each other, in MuJoCo's collision shapes."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.robot.kinematics import compiled


@dataclass(frozen=True, kw_only=True)
class SelfCollision:
    """The deepest overlap of each frame."""

    depth: Float[np.ndarray, " t"]
    """[m], 0 where nothing overlaps."""
    pairs: tuple[tuple[str, str] | None, ...]
    """Names of the two shapes that overlap most; None where none do."""


def self_collision(clip: RobotClip, robot: Robot) -> SelfCollision:
    """Overlap of shapes of links that are not parent and child; the ground is not looked at."""
    model = _model(robot.mjcf)
    data = mujoco.MjData(model)
    qpos = np.concatenate([clip.root_pos_w, clip.root_quat_w, clip.joint_pos], axis=1)
    depth = np.zeros(clip.frame_count)
    pairs: list[tuple[str, str] | None] = [None] * clip.frame_count
    for frame in range(clip.frame_count):
        data.qpos[:] = qpos[frame]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        if data.ncon:
            worst = int(np.argmin(data.contact.dist))
            depth[frame] = max(-float(data.contact.dist[worst]), 0.0)
            shapes = data.contact.geom[worst]
            pairs[frame] = (model.geom(shapes[0]).name, model.geom(shapes[1]).name)
    return SelfCollision(depth=depth, pairs=tuple(pairs))


@functools.lru_cache(maxsize=4)
def _model(mjcf: str) -> mujoco.MjModel:
    """The compiled model of a robot, which nobody changes: compiling takes longer than many a clip."""
    return compiled(mjcf)
