"""Infeasibilities planted into a robot motion that is known to be good."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from pipeline.augment.mirror import time_scale_clip
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot

Fault = Callable[[RobotClip, Robot, np.random.Generator], RobotClip]


def joint_past_limit(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """A controlled joint swings to .1 to .4 rad past one of its limits and back, within about a second."""
    joint = robot.joint(str(rng.choice(robot.controlled)))
    limit = robot.joint_upper[joint] + 0.1 if rng.random() < 0.5 else robot.joint_lower[joint] - 0.1
    limit += np.sign(limit) * rng.uniform(0.0, 0.3)
    middle = int(rng.integers(0, clip.frame_count))
    width = int(0.5 * clip.fps)
    share = np.clip(1.0 - np.abs(np.arange(clip.frame_count) - middle) / width, 0.0, 1.0)
    share = 0.5 - 0.5 * np.cos(np.pi * share)
    joints = clip.joint_pos.copy()
    joints[:, joint] += share * (limit - joints[middle, joint])
    joints[middle, joint] = limit
    return dataclasses.replace(clip, joint_pos=joints)


def teleport(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """The whole robot is 5 to 50 cm elsewhere from some frame on."""
    angle, length = rng.uniform(-np.pi, np.pi), rng.uniform(0.05, 0.5)
    frame = int(rng.integers(clip.frame_count // 5, 4 * clip.frame_count // 5))
    root = clip.root_pos_w.copy()
    root[frame:, :2] += length * np.array([np.cos(angle), np.sin(angle)])
    return dataclasses.replace(clip, root_pos_w=root)


def double_speed(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Played twice as fast."""
    return time_scale_clip(clip, 2.0, clip.name)


def feet_swapped(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Left and right leg exchanged, each mirrored; root, arms and contact labels stay."""
    joints = clip.joint_pos.copy()
    legs = [i for i, name in enumerate(robot.joint_names) if "Hip" in name or "Knee" in name or "Ankle" in name]
    joints[:, legs] = (robot.mirror_sign * clip.joint_pos[:, robot.mirror_index])[:, legs]
    return dataclasses.replace(clip, joint_pos=joints)


def floor_up(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """The robot is 5 cm too low."""
    return dataclasses.replace(clip, root_pos_w=clip.root_pos_w - np.array([0.0, 0.0, 0.05]))


def floor_down(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """The robot is 5 cm too high."""
    return dataclasses.replace(clip, root_pos_w=clip.root_pos_w + np.array([0.0, 0.0, 0.05]))


def unlabelled(fault: Fault) -> Fault:
    """The fault in a clip whose source says nothing of contacts."""

    def plant(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
        return dataclasses.replace(fault(clip, robot, rng), contacts=None)

    return plant


FAULTS: dict[str, Fault] = {
    "joint past its limit": joint_past_limit,
    "teleport": teleport,
    "double speed": double_speed,
    "feet swapped": feet_swapped,
    "floor 5 cm high": floor_up,
    "floor 5 cm low": floor_down,
    "floor 5 cm high, no labels": unlabelled(floor_up),
    "floor 5 cm low, no labels": unlabelled(floor_down),
    "teleport, no labels": unlabelled(teleport),
}
