"""The mirror image of a robot's motion: its reflection in the plane y = 0."""

import dataclasses

import numpy as np
from jaxtyping import Float

from pipeline.clips.robot_clip import RobotClip
from pipeline.robot.robot import Robot

POSITION = np.array([1.0, -1.0, 1.0])
"""Signs of a position's mirror image."""
QUATERNION = np.array([1.0, -1.0, 1.0, -1.0])
"""Signs of a quaternion's mirror image S R S, S = diag(1, -1, 1): rotations about x and z change sign."""
MARK = "~mirror"
"""Suffix of the name of a mirrored motion."""


def mirror_clip(clip: RobotClip, robot: Robot, name: str) -> RobotClip:
    """Mirror a clip: left and right joints, hands and feet are exchanged. Applied twice, it is the exact identity."""
    return dataclasses.replace(
        clip,
        name=name,
        root_pos_w=clip.root_pos_w * POSITION,
        root_quat_w=clip.root_quat_w * QUATERNION,
        joint_pos=clip.joint_pos[:, robot.mirror_index] * robot.mirror_sign,
        contacts=None if clip.contacts is None else clip.contacts[:, ::-1].copy(),
    )


def mirror_corners(vectors_w: Float[np.ndarray, "t 2 4 3"], robot: Robot) -> Float[np.ndarray, "t 2 4 3"]:
    """Mirror positions or velocities of the sole corners; each corner is the image of one of the other sole."""
    sites = [[robot.tree.site_names.index(name) for name in names] for names in robot.sole_corners]
    left, right = (robot.tree.site_pos[each] for each in sites)
    partner = np.linalg.norm(right[:, None] - left * POSITION, axis=-1).argmin(axis=1)
    return np.stack([vectors_w[:, 1, np.argsort(partner)], vectors_w[:, 0, partner]], axis=1) * POSITION
