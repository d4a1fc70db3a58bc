"""The mirror image of a robot's motion: its reflection in the plane y = 0."""

from __future__ import annotations

import dataclasses

import numpy as np

from pipeline.clips.robot_clip import RobotClip
from pipeline.robot.robot import Robot

POSITION = np.array([1.0, -1.0, 1.0])
"""Signs of a position's mirror image."""
QUATERNION = np.array([1.0, -1.0, 1.0, -1.0])
"""Reflecting y turns R into S R S with S = diag(1, -1, 1): rotations about x and z change sign, about y they stay."""
MARK = "~mirror"
"""What the name of a mirror image has and the name of the motion does not."""


def mirror_clip(clip: RobotClip, robot: Robot, name: str) -> RobotClip:
    """The clip in a mirror: left and right joints, hands and feet exchanged. Twice gives the clip again, exactly."""
    return dataclasses.replace(
        clip,
        name=name,
        root_pos_w=clip.root_pos_w * POSITION,
        root_quat_w=clip.root_quat_w * QUATERNION,
        joint_pos=clip.joint_pos[:, robot.mirror_index] * robot.mirror_sign,
        contacts=None if clip.contacts is None else clip.contacts[:, ::-1].copy(),
    )
