"""Robot clips with known truth, made without the code they test."""

from __future__ import annotations

import numpy as np

from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot


def standing(robot: Robot, seconds: float = 2.0, fps: float = 50.0, name: str = "test/stand") -> RobotClip:
    """The default pose, at rest on the ground."""
    count = round(seconds * fps)
    return RobotClip(
        name=name,
        fps=fps,
        robot=robot.name,
        joint_names=robot.joint_names,
        root_pos_w=np.tile([0.0, 0.0, robot.default_root_height], (count, 1)),
        root_quat_w=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        joint_pos=np.tile(robot.default_joint_pos, (count, 1)),
        contacts=np.ones((count, 2), dtype=bool),
    )


def wandering(robot: Robot, seconds: float = 2.0, fps: float = 50.0, seed: int = 0) -> RobotClip:
    """Every joint and the root in slow sines of different phases: nothing is symmetric, nothing stands still."""
    rng = np.random.default_rng(seed)
    count = round(seconds * fps)
    times_s = np.arange(count)[:, None] / fps
    phases = rng.uniform(0.0, 2.0 * np.pi, (1, len(robot.joint_names)))
    middle, half = (robot.joint_lower + robot.joint_upper) / 2.0, (robot.joint_upper - robot.joint_lower) / 2.0
    yaw = 0.4 * times_s[:, 0] + 0.2
    tilt = 0.1 * np.sin(3.0 * times_s[:, 0])
    quat = np.stack(
        [
            np.cos(yaw / 2) * np.cos(tilt / 2),
            np.cos(yaw / 2) * np.sin(tilt / 2),
            np.sin(yaw / 2) * np.sin(tilt / 2),
            np.sin(yaw / 2) * np.cos(tilt / 2),
        ],
        axis=1,
    )
    root = np.concatenate([0.5 * times_s, 0.2 * np.sin(2.0 * times_s), 0.7 + 0.02 * np.cos(4.0 * times_s)], axis=1)
    return RobotClip(
        name="test/wander",
        fps=fps,
        robot=robot.name,
        joint_names=robot.joint_names,
        root_pos_w=root,
        root_quat_w=quat,
        joint_pos=middle + 0.5 * half * np.sin(2.0 * times_s + phases),
        contacts=np.stack([times_s[:, 0] % 1.0 < 0.5, times_s[:, 0] % 1.0 >= 0.4], axis=1),
    )
