"""Faults planted into known-good motion, the criteria that must find them, and whether a fault is large enough."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.quality.sole import sole_motion
from pipeline.robot import Kinematics, Robot
from pipeline.simulation.mujoco_plant import self_collision
from tests.factories.robot_faults import FAULTS as IN_TESTS

MATTERS_M = 0.05
"""Least displacement of the most displaced body [m]."""
SIDES = ("Left", "Right")
ARM = ("Shoulder_Pitch", "Shoulder_Roll", "Elbow_Pitch", "Elbow_Yaw")
OVERLAP_M, TRIES = 0.04, 200
"""Depth to which an arm is put into the body, and how many postures are drawn at most to find one; where none is found,
nothing is counted."""
ARM_IN_BODY = "arm in the body"
LABELS = "labels exchanged"
"""The one that moves no body: what it says of the feet is wrong ..."""
WRONG_SHARE = 0.4
"""... in at least that many of the foot-frames."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A kind of planted fault."""

    plant: Callable[[RobotClip, Robot, np.random.Generator], RobotClip]
    group: str
    """Group of criteria designed to find it."""


def displacement(before: RobotClip, after: RobotClip, robot: Robot) -> float:
    """Largest displacement of a link, hand or sole corner from its position at the same time [m]."""
    count = min(before.frame_count, after.frame_count)
    here, there = (_points_w(clip, robot)[:count] for clip in (before, after))
    return float(np.linalg.norm(here - there, axis=2).max())


def matters(name: str, before: RobotClip, after: RobotClip, robot: Robot) -> bool:
    """Whether a planted fault is large enough to be counted."""
    if name == LABELS:
        assert before.contacts is not None
        assert after.contacts is not None
        return float(np.mean(before.contacts != after.contacts)) >= WRONG_SHARE
    if name == ARM_IN_BODY and self_collision(after, robot).depth.max() < OVERLAP_M:
        return False
    return displacement(before, after, robot) >= MATTERS_M


def _points_w(clip: RobotClip, robot: Robot) -> Float[np.ndarray, "t p 3"]:
    kinematics = Kinematics(robot)
    poses = kinematics.forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    sites = (*robot.hands, *robot.sole_corners[0], *robot.sole_corners[1])
    return np.concatenate([poses.pos_w, kinematics.site_pos_w(poses, sites)], axis=1)


def arm_in_body(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Swing an arm, within its limits, at least 0.04 m deep into the body and back within a second."""
    side = SIDES[int(rng.integers(2))]
    arm = [robot.joint(f"{side}_{name}") for name in ARM]
    middle = int(rng.integers(clip.frame_count))
    deepest, posture = 0.0, clip.joint_pos[middle, arm]
    for _ in range(TRIES):
        drawn = rng.uniform(robot.joint_lower[arm], robot.joint_upper[arm])
        depth = self_collision(_with_joints(clip.cut(middle, middle + 1, "frame"), arm, drawn), robot).depth[0]
        if depth > deepest:
            deepest, posture = depth, drawn
        if deepest >= OVERLAP_M:
            break
    share = _bump(clip, middle, 0.5)[:, None]
    return _with_joints(clip, arm, (1.0 - share) * clip.joint_pos[:, arm] + share * posture)


def tilted(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Tilt the robot by 55 to 85 degrees in any direction about the ground below it, and back, in two seconds."""
    angle, way = np.radians(rng.uniform(55.0, 85.0)), rng.uniform(-np.pi, np.pi)
    return _tipped(clip, angle, way, int(rng.integers(clip.frame_count)))


def crouched(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Fold both legs, with feet level and at their height, until the thighs are 55 to 65 degrees further, in 2 s."""
    bend = np.radians(rng.uniform(55.0, 65.0)) * _bump(clip, int(rng.integers(clip.frame_count)), 1.0)
    joints = clip.joint_pos.copy()
    for side in SIDES:
        for name, times in (("Hip_Pitch", -1.0), ("Knee_Pitch", 2.0), ("Ankle_Pitch", -1.0)):
            joints[:, robot.joint(f"{side}_{name}")] += times * bend
    folded = dataclasses.replace(clip, joint_pos=joints)
    up = sole_motion(clip, robot).height.min(axis=1) - sole_motion(folded, robot).height.min(axis=1)
    return dataclasses.replace(folded, root_pos_w=clip.root_pos_w + np.outer(up, [0.0, 0.0, 1.0]))


def hovering(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Lift the robot by 0.05 to 0.3 m for 0.7 to 1.2 s, and label its feet as not in contact."""
    half = rng.uniform(0.35, 0.6)
    away = np.abs(np.arange(clip.frame_count) - int(rng.integers(clip.frame_count // 5, 4 * clip.frame_count // 5)))
    share = np.clip((half + 0.1 - away / clip.fps) / 0.1, 0.0, 1.0)
    up = np.outer(rng.uniform(0.05, 0.3) * share, [0.0, 0.0, 1.0])
    contacts = None if clip.contacts is None else clip.contacts & (share == 0.0)[:, None]
    return dataclasses.replace(clip, root_pos_w=clip.root_pos_w + up, contacts=contacts)


def carried_off(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Move the robot at 5 to 8 m/s for half a second in any direction."""
    speed, way = rng.uniform(5.0, 8.0), rng.uniform(-np.pi, np.pi)
    share = _bump(clip, int(rng.integers(clip.frame_count // 5, 4 * clip.frame_count // 5)), 0.5)
    gone = np.cumsum(speed * share)[:, None] / clip.fps * np.array([np.cos(way), np.sin(way), 0.0])
    return dataclasses.replace(clip, root_pos_w=clip.root_pos_w + gone)


def spun(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Rotate the robot about the vertical, at a peak of 9 to 14 rad/s, within a second."""
    rate = rng.uniform(9.0, 14.0) * (1.0 if rng.random() < 0.5 else -1.0)
    middle = int(rng.integers(clip.frame_count // 5, 4 * clip.frame_count // 5))
    turn = rotation.about_z(np.cumsum(rate * _bump(clip, middle, 0.5)) / clip.fps)
    centre = clip.root_pos_w[middle]
    root = centre + rotation.rotate(turn, clip.root_pos_w - centre)
    return dataclasses.replace(clip, root_pos_w=root, root_quat_w=rotation.multiply(turn, clip.root_quat_w))


def shaken_joints(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Shake every controlled joint by 0.25 to 0.4 rad at 7 to 9 Hz, with random phases."""
    times_s = np.arange(clip.frame_count)[:, None] / clip.fps
    moved = robot.controlled_index
    phase, rate = rng.uniform(0.0, 2.0 * np.pi, len(moved)), rng.uniform(7.0, 9.0, len(moved))
    joints = clip.joint_pos.copy()
    joints[:, moved] += rng.uniform(0.25, 0.4) * np.sin(2.0 * np.pi * rate * times_s + phase)
    return dataclasses.replace(clip, joint_pos=joints)


def shaken_root(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Shake the robot by 0.05 to 0.1 m at 4 to 6 Hz, along any horizontal direction."""
    times_s, way = np.arange(clip.frame_count) / clip.fps, rng.uniform(-np.pi, np.pi)
    swing = rng.uniform(0.05, 0.1) * np.sin(2.0 * np.pi * rng.uniform(4.0, 6.0) * times_s + rng.uniform(0.0, 6.0))
    root = clip.root_pos_w + swing[:, None] * np.array([np.cos(way), np.sin(way), 0.0])
    return dataclasses.replace(clip, root_pos_w=root)


def skating(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Add 1 to 2 m/s to the robot's own motion, including the feet, from start to end."""
    speed, way = rng.uniform(1.0, 2.0), rng.uniform(-np.pi, np.pi)
    gone = speed * np.arange(clip.frame_count)[:, None] / clip.fps * np.array([np.cos(way), np.sin(way), 0.0])
    return dataclasses.replace(clip, root_pos_w=clip.root_pos_w + gone)


def labels_exchanged(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Exchange the contact labels of the left and the right foot."""
    contacts = None if clip.contacts is None else clip.contacts[:, ::-1].copy()
    return dataclasses.replace(clip, contacts=contacts)


def _tipped(clip: RobotClip, angle: float, way: float, middle: int) -> RobotClip:
    axis = np.array([np.cos(way), np.sin(way), 0.0])
    turn = rotation.from_axis_angle(axis, angle * _bump(clip, middle, 1.0))
    below = clip.root_pos_w * np.array([1.0, 1.0, 0.0])
    root = below + rotation.rotate(turn, clip.root_pos_w - below)
    return dataclasses.replace(clip, root_pos_w=root, root_quat_w=rotation.multiply(turn, clip.root_quat_w))


def _with_joints(clip: RobotClip, joints: list[int], values: np.ndarray) -> RobotClip:
    changed = clip.joint_pos.copy()
    changed[:, joints] = values
    return dataclasses.replace(clip, joint_pos=changed)


def _bump(clip: RobotClip, middle: int, half_s: float) -> Float[np.ndarray, " t"]:
    """Smooth bump from 0 to 1 at a frame and back to 0, of duration 2 `half_s` [s]."""
    away = np.abs(np.arange(clip.frame_count) - middle) / clip.fps
    return 0.5 + 0.5 * np.cos(np.pi * np.clip(away / half_s, 0.0, 1.0))


_GROUPS = {
    "joint past its limit": "joint and speed limits",
    "teleport": "root motion",
    "double speed": "joint and speed limits",
    "feet swapped": "foot slip",
    "floor 5 cm high": "penetration",
    "floor 5 cm low": "contact consistency",
}

FAULTS: dict[str, Fault] = {
    **{name: Fault(plant=IN_TESTS[name], group=group) for name, group in _GROUPS.items()},
    ARM_IN_BODY: Fault(plant=arm_in_body, group="self-collision"),
    "tilted by 55 to 85 degrees": Fault(plant=tilted, group="root motion"),
    "crouched": Fault(plant=crouched, group="root motion"),
    "hovering": Fault(plant=hovering, group="contact consistency"),
    "carried off": Fault(plant=carried_off, group="root motion"),
    "spun": Fault(plant=spun, group="root motion"),
    "joints shaken": Fault(plant=shaken_joints, group="smoothness"),
    "root shaken": Fault(plant=shaken_root, group="smoothness"),
    "skating": Fault(plant=skating, group="foot slip"),
    LABELS: Fault(plant=labels_exchanged, group="contact consistency"),
}
