"""How far a rollout is from the reference it tracked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Kinematics, Robot


@dataclass(frozen=True, kw_only=True)
class TrackingError:
    """Errors of each frame."""

    body: Float[np.ndarray, " t"]
    """Mean distance of the key links from the reference, which is moved to the robot's place and heading [m]."""
    joint: Float[np.ndarray, " t"]
    """Mean absolute error of the controlled joints [rad]."""
    path: Float[np.ndarray, " t"]
    """Horizontal distance of the root from the reference's root [m]."""


def tracking_error(clip: RobotClip, reference: RobotClip, robot: Robot) -> TrackingError:
    """Error of a rollout at each frame against the same frame of its reference.

    The distance is mjlab's root-relative mean per-keybody position error (`compute_root_relative_mpkpe`): the reference
    is moved horizontally to the robot's root and turned to its heading; its height stays.
    """
    here, there = (_key_links(each, robot) for each in (clip, reference))
    turn = rotation.about_z(rotation.yaw_of(clip.root_quat_w) - rotation.yaw_of(reference.root_quat_w))
    away = rotation.rotate(turn[:, None], there - reference.root_pos_w[:, None])
    anchor = np.concatenate([clip.root_pos_w[:, :2], reference.root_pos_w[:, 2:]], axis=1)
    moved = robot.controlled_index
    return TrackingError(
        body=np.linalg.norm(here - anchor[:, None] - away, axis=2).mean(axis=1),
        joint=np.abs(clip.joint_pos - reference.joint_pos)[:, moved].mean(axis=1),
        path=np.linalg.norm((clip.root_pos_w - reference.root_pos_w)[:, :2], axis=1),
    )


def _key_links(clip: RobotClip, robot: Robot) -> Float[np.ndarray, "t k 3"]:
    poses = Kinematics(robot).forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    return poses.pos_w[:, [robot.link(name) for name in robot.key_links]]
