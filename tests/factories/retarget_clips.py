"""Human clips for retargeting whose answer is known: other heights, mirror images, and the robot as a person."""

from __future__ import annotations

import dataclasses

import numpy as np

from pipeline import rotation
from pipeline.clips.human_clip import BODIES, HumanClip, body
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Kinematics, Robot


def scaled(clip: HumanClip, factor: float) -> HumanClip:
    """The same motion by a person `factor` times as tall, in the same time."""
    return dataclasses.replace(clip, body_pos_w=clip.body_pos_w * factor)


def mirrored(clip: HumanClip) -> HumanClip:
    """The clip reflected in the plane y = 0: sides swapped, y turned, rotations about x and z turned."""
    swap = [body(_other_side(name)) for name in BODIES]
    return dataclasses.replace(
        clip,
        body_pos_w=clip.body_pos_w[:, swap] * [1.0, -1.0, 1.0],
        body_quat_w=clip.body_quat_w[:, swap] * [1.0, -1.0, 1.0, -1.0],
        contacts=None if clip.contacts is None else clip.contacts[:, ::-1].copy(),
    )


def person_of(clip: RobotClip, robot: Robot, toe: np.ndarray) -> HumanClip:
    """A person with the robot's own limbs who does what the robot does; `toe` is in the foot link's frame [m]."""
    kinematics = Kinematics(robot)
    poses = kinematics.forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    trunk, pelvis = (robot.link(robot.human[name]) for name in ("trunk", "pelvis"))
    pos = np.repeat(poses.pos_w[:, pelvis, None], len(BODIES), axis=1)
    quat = np.repeat(poses.quat_w[:, trunk, None], len(BODIES), axis=1)
    quat[:, body("pelvis")] = poses.quat_w[:, pelvis]
    for name in BODIES:
        if name in robot.human and robot.human[name] in robot.site_names:
            pos[:, body(name)] = kinematics.site_pos_w(poses, (robot.human[name],))[:, 0]
    for side in ("left", "right"):
        foot = robot.link(robot.human[f"{side}_foot"])
        toe_w = poses.pos_w[:, foot] + rotation.rotate(poses.quat_w[:, foot], toe)
        pos[:, body(f"{side}_toe")] = toe_w
    return HumanClip(name=clip.name, fps=clip.fps, body_pos_w=pos, body_quat_w=quat, contacts=clip.contacts)


def _other_side(name: str) -> str:
    for side, other in (("left", "right"), ("right", "left")):
        if name.startswith(side):
            return other + name.removeprefix(side)
    return name
