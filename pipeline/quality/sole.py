"""Positions and velocities of the sole corners of a robot motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import time_series
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Kinematics, Robot


@dataclass(frozen=True, kw_only=True)
class SoleMotion:
    """Corners of the left and right sole over T frames."""

    fps: float
    corner_pos_w: Float[np.ndarray, "t 2 4 3"]
    """[m]"""
    corner_vel_w: Float[np.ndarray, "t 2 4 3"]
    """[m/s], central differences."""

    @property
    def height(self) -> Float[np.ndarray, "t 2"]:
        """Height of the lowest corner over the ground [m]; negative below it."""
        return self.corner_pos_w[..., 2].min(axis=2)

    @property
    def lowest_corner_speed(self) -> Float[np.ndarray, "t 2"]:
        """Horizontal speed of the lowest corner [m/s]."""
        lowest = self.corner_pos_w[..., 2].argmin(axis=2)[..., None, None]
        velocity = np.take_along_axis(self.corner_vel_w, np.broadcast_to(lowest, (*lowest.shape[:3], 3)), axis=2)
        return np.linalg.norm(velocity[:, :, 0, :2], axis=-1)

    @property
    def mean_speed(self) -> Float[np.ndarray, "t 2"]:
        """Speed of the sole's centre [m/s], vertical part included."""
        return np.linalg.norm(self.corner_vel_w.mean(axis=2), axis=-1)


def sole_motion(clip: RobotClip, robot: Robot) -> SoleMotion:
    """The soles of a clip at the clip's own rate."""
    kinematics = Kinematics(robot)
    poses = kinematics.forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    names = [name for side in robot.sole_corners for name in side]
    corners = kinematics.site_pos_w(poses, names).reshape(-1, 2, 4, 3)
    return SoleMotion(fps=clip.fps, corner_pos_w=corners, corner_vel_w=time_series.derivative(corners, clip.fps))
