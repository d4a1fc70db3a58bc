"""Whether a clip can be played in a circle."""

from __future__ import annotations

import numpy as np

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip

MAX_JOINT_STEP = 0.05
"""Largest change of a joint over the seam [rad] beyond what one frame of motion makes (judgement: 2.5 rad/s)."""

MAX_ROOT_STEP = 0.01
"""Largest change of the root's height [m] and tilt [rad] over the seam (judgement: half a metre a second)."""


def loop_mode(clip: RobotClip) -> str:
    """`Wrap` where the frame after the last could be the first, else `Clamp`.

    Held against each other: joints, root height and gravity in the root frame one frame after the end
    (continued at the end's velocity), and the same at the start. Place and heading may differ.
    """
    if clip.frame_count < 3:
        return "Clamp"
    joints = 2.0 * clip.joint_pos[-1] - clip.joint_pos[-2] - clip.joint_pos[0]
    height = 2.0 * clip.root_pos_w[-1, 2] - clip.root_pos_w[-2, 2] - clip.root_pos_w[0, 2]
    down_b = rotation.rotate_inverse(clip.root_quat_w[[0, -2, -1]], np.array([0.0, 0.0, -1.0]))
    tilt = np.linalg.norm(2.0 * down_b[2] - down_b[1] - down_b[0])
    closes = np.max(np.abs(joints)) <= MAX_JOINT_STEP and abs(height) <= MAX_ROOT_STEP and tilt <= MAX_ROOT_STEP
    return "Wrap" if closes else "Clamp"
