"""The smallest valid clips, and clips whose every number tells where it belongs."""

import numpy as np

from pipeline import rotation
from pipeline.clips.human_clip import BODIES, HumanClip
from pipeline.clips.robot_clip import RobotClip


def human_clip(frames: int = 5, name: str = "test/human") -> HumanClip:
    """Positions are 100 x frame + body + axis / 10, orientations a slow turn."""
    frame, body, axis = np.meshgrid(np.arange(frames), np.arange(len(BODIES)), np.arange(3), indexing="ij")
    quat = np.repeat(rotation.about_z(0.01 * np.arange(frames))[:, None], len(BODIES), axis=1)
    contacts = np.stack([np.arange(frames) % 2 == 0, np.arange(frames) % 3 == 0], axis=1)
    return HumanClip(
        name=name, fps=60.0, body_pos_w=100.0 * frame + body + axis / 10.0, body_quat_w=quat, contacts=contacts
    )


def robot_clip(frames: int = 5, fps: float = 50.0, name: str = "test/robot") -> RobotClip:
    """Joint positions are frame + joint / 100; the root walks along x at 1 m/s."""
    names = ("hip", "knee", "ankle")
    return RobotClip(
        name=name,
        fps=fps,
        robot="test",
        joint_names=names,
        root_pos_w=np.stack([np.arange(frames) / fps, np.zeros(frames), np.full(frames, 0.7)], axis=1),
        root_quat_w=np.tile(rotation.IDENTITY, (frames, 1)),
        joint_pos=np.arange(frames)[:, None] + np.arange(3)[None] / 100.0,
    )
