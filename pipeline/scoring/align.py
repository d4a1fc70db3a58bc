"""Align human and robot in time: equal start, the human resampled to the robot's rate."""

from __future__ import annotations

import numpy as np

from pipeline import rotation
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.robot import Kinematics, Robot

TOLERANCE_S = 0.05
"""Largest difference of their lengths, on top of a frame of each [s], for rounding at two rates."""

MAX_TURNED_DEG = 60.0
"""Mean heading difference above which both are in different worlds [deg]; the worst measured retargeting is 20 degrees
off."""


def same_length(human: HumanClip, clip: RobotClip) -> bool:
    """Whether the lengths are those of the same motion."""
    slack_s = TOLERANCE_S + 1.0 / human.fps + 1.0 / clip.fps
    return abs(human.duration_s - clip.duration_s) <= slack_s


def aligned(human: HumanClip, clip: RobotClip, robot: Robot) -> tuple[HumanClip, RobotClip]:
    """Both at the robot clip's rate and equally long.

    Raises ClipError for clips of different lengths, and for a robot that faces another way than the human: then it was
    made from the motion as recorded, not as repair hands it on (moved to the origin, turned to face +x).
    """
    if not same_length(human, clip):
        problem = f"it is {clip.duration_s:.2f} s long, the human '{human.name}' {human.duration_s:.2f} s."
        raise ClipError(clip.name, "length", problem)
    human = human.resampled(clip.fps)
    frames = min(human.frame_count, clip.frame_count)
    human, clip = human.cut(0, frames, human.name), clip.cut(0, frames, clip.name)
    turned_deg = _turned_deg(human, clip, robot)
    if turned_deg > MAX_TURNED_DEG:
        problem = (
            f"the robot faces {turned_deg:.0f} degrees away from the human on average, {MAX_TURNED_DEG:.0f} allowed; "
        )
        raise ClipError(clip.name, "placement", problem + "retarget the human's motion as repair hands it on.")
    return human, clip


def _turned_deg(human: HumanClip, clip: RobotClip, robot: Robot) -> float:
    """Angle between the headings of the robot's pelvis and the human's hips, circular mean, without its sign [deg]."""
    poses = Kinematics(robot).forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    hip_line_w = human.pos("left_hip") - human.pos("right_hip")
    heading = np.arctan2(-hip_line_w[:, 0], hip_line_w[:, 1])
    turned = rotation.yaw_of(poses.quat_w[:, robot.link(robot.human["pelvis"])]) - heading
    return float(np.abs(np.rad2deg(np.arctan2(np.sin(turned).mean(), np.cos(turned).mean()))))
