"""The reflection of a robot motion, and of its numbers, in the plane y = 0."""

from __future__ import annotations

import dataclasses

import numpy as np

from pipeline.clips.outcome import Number, Numbers
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot

_MIRRORED_POS = np.array([1.0, -1.0, 1.0])
_MIRRORED_QUAT = np.array([1.0, -1.0, 1.0, -1.0])
"""Reflecting y turns R into S R S with S = diag(1, -1, 1): rotations about x and z change sign, about y they stay."""

_ODD_NUMBERS = ("lateral_m_s", "yaw_rate_rad_s", "heading_rad")
"""Numbers that change their sign in a mirror."""


def mirror_clip(clip: RobotClip, robot: Robot, name: str) -> RobotClip:
    """The clip seen in a mirror: left and right joints, hands and feet exchanged. Twice gives the clip again."""
    return dataclasses.replace(
        clip,
        name=name,
        root_pos_w=clip.root_pos_w * _MIRRORED_POS,
        root_quat_w=clip.root_quat_w * _MIRRORED_QUAT,
        joint_pos=clip.joint_pos[:, robot.mirror_index] * robot.mirror_sign,
        contacts=None if clip.contacts is None else clip.contacts[:, ::-1].copy(),
    )


def mirror_skill(skill: str) -> str:
    """The skill's name in a mirror: `turn_left` becomes `turn_right`, `walk` stays."""
    if skill.endswith("_left"):
        return skill.removesuffix("left") + "right"
    if skill.endswith("_right"):
        return skill.removesuffix("right") + "left"
    return skill


def mirror_numbers(numbers: Numbers) -> dict[str, Number]:
    """Numbers of earlier stages, as they are for the mirrored clip."""
    mirrored = dict(numbers)
    for name in _ODD_NUMBERS:
        value = mirrored.get(name)
        if isinstance(value, (int, float)):
            mirrored[name] = -value if value else value
    skill = mirrored.get("skill")
    if isinstance(skill, str):
        mirrored["skill"] = mirror_skill(skill)
    return mirrored
