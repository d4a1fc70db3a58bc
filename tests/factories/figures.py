"""Small clips to draw: a person and a robot whose pose in every frame is known."""

import numpy as np

from pipeline.clips.human_clip import BODIES, HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot

STANDING: dict[str, tuple[float, float, float]] = {
    "pelvis": (0.0, 0.0, 0.95),
    "spine": (0.0, 0.0, 1.05),
    "chest": (0.0, 0.0, 1.25),
    "neck": (0.0, 0.0, 1.45),
    "head": (0.0, 0.0, 1.55),
    "left_hip": (0.0, 0.09, 0.90),
    "left_knee": (0.0, 0.09, 0.48),
    "left_ankle": (0.0, 0.09, 0.08),
    "left_toe": (0.14, 0.09, 0.02),
    "right_hip": (0.0, -0.09, 0.90),
    "right_knee": (0.0, -0.09, 0.48),
    "right_ankle": (0.0, -0.09, 0.08),
    "right_toe": (0.14, -0.09, 0.02),
    "left_shoulder": (0.0, 0.18, 1.40),
    "left_elbow": (0.0, 0.20, 1.12),
    "left_wrist": (0.0, 0.21, 0.87),
    "right_shoulder": (0.0, -0.18, 1.40),
    "right_elbow": (0.0, -0.20, 1.12),
    "right_wrist": (0.0, -0.21, 0.87),
}
"""A person who stands upright and looks along +x [m]."""


def gliding_human(frame_count: int = 61, fps: float = 30.0) -> HumanClip:
    """A standing person pushed along +x at 0.5 m/s; the left foot is called on the ground in even frames."""
    pos = np.tile(np.array([STANDING[name] for name in BODIES]), (frame_count, 1, 1))
    pos[:, :, 0] += (0.5 * np.arange(frame_count) / fps)[:, None]
    quat = np.zeros((frame_count, len(BODIES), 4))
    quat[..., 0] = 1.0
    even = np.arange(frame_count) % 2 == 0
    contacts = np.stack([even, np.ones(frame_count, dtype=bool)], axis=1)
    return HumanClip(name="made/glide", fps=fps, body_pos_w=pos, body_quat_w=quat, contacts=contacts)


def tumbling_robot(robot: Robot, frame_count: int = 101) -> RobotClip:
    """Poses all over the joints' ranges, the root turned and moved differently in every frame."""
    random = np.random.default_rng(7)
    share = random.uniform(0.0, 1.0, (frame_count, len(robot.joint_names)))
    quat = random.normal(size=(frame_count, 4))
    return RobotClip(
        name="made/tumble",
        fps=50.0,
        robot=robot.name,
        joint_names=robot.joint_names,
        root_pos_w=random.uniform(-1.0, 1.0, (frame_count, 3)) + np.array([0.0, 0.0, 1.0]),
        root_quat_w=quat / np.linalg.norm(quat, axis=1, keepdims=True),
        joint_pos=robot.joint_lower + share * (robot.joint_upper - robot.joint_lower),
    )


def standing_robot(robot: Robot, frame_count: int = 101, fps: float = 50.0) -> RobotClip:
    """The default pose on the ground, pushed along +x at .3 m/s, nodding."""
    seconds = np.arange(frame_count) / fps
    joints = np.tile(robot.default_joint_pos, (frame_count, 1))
    joints[:, robot.joint("Head_pitch")] += 0.2 * np.sin(3.0 * seconds)
    pos = np.zeros((frame_count, 3))
    pos[:, 0], pos[:, 2] = 0.3 * seconds, robot.default_root_height
    return RobotClip(
        name="made/nod",
        fps=fps,
        robot=robot.name,
        joint_names=robot.joint_names,
        root_pos_w=pos,
        root_quat_w=np.tile([1.0, 0.0, 0.0, 0.0], (frame_count, 1)),
        joint_pos=joints,
    )
