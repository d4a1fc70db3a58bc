"""Perturb a robot motion: step length, step width, foot lift or trunk lean.

clip -> target poses of root and feet -> inverse kinematics of the legs -> clip

A foot in stance keeps its orientation and height at another position. Everything else (waist, arms, head, roll of the
feet, contact times) is that of the original.
"""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation, time_series
from pipeline.augment.leg_solver import Leg, legs_of, lift_in_swings, offset_by_stance, reach, within_limits
from pipeline.clips.outcome import Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.quality.planar_motion import STRIDE_S
from pipeline.quality.sole import ContactSettings, contact_from_sole, sole_motion
from pipeline.robot import Kinematics, LinkPoses, Robot

LEAST_CHANGE = 0.004
"""Least displacement of feet or root from the original for a variant [m]."""

LEAST_LEAN = 1e-3
"""Least change of the trunk's lean for a variant [rad]."""

WALKING_M_S = 0.05
"""Root speed above which its direction defines the direction of travel [m/s]."""

MOST_LOWERED = 0.03
"""Most that the root may be lowered so that the legs reach [m]."""


@dataclass(frozen=True, kw_only=True)
class Gait:
    """Quantities of the original that the perturbations use."""

    clip: RobotClip
    poses: LinkPoses
    contacts: Bool[np.ndarray, "t 2"]
    foot_pos_w: Float[np.ndarray, "t 2 3"]
    """Centres of the soles [m]."""
    clearance: Float[np.ndarray, "t 2"]
    """Height of the lowest corner of each sole [m]."""
    hips_w: Float[np.ndarray, "t 3"]
    """Midpoint between the hips [m]."""
    heading: Float[np.ndarray, " t"]
    """Heading of the root, without its oscillation in each stride [rad]."""


@dataclass(frozen=True, kw_only=True)
class Course:
    """Target poses of root and feet."""

    root_pos_w: Float[np.ndarray, "t 3"]
    root_quat_w: Float[np.ndarray, "t 4"]
    foot_offset_w: Float[np.ndarray, "t 2 3"]
    """Offset of the feet from the original [m]."""


def perturb(
    clip: RobotClip, robot: Robot, kind: str, strength: float, name: str, contact: ContactSettings
) -> RobotClip | Reason:
    """The clip with a perturbation of `pipeline.augment.process.KINDS`, or the reason why there is none.

    `contact` has the limits for inferring contacts in a clip without labels.
    """
    gait = gait_of(clip, robot, contact)
    course = _COURSES[kind](gait, strength)
    if _nothing_changed(gait, course):
        text = f"is not made: less than {100 * LEAST_CHANGE:g} cm would change."
        return Reason(code="nothing_to_perturb", text=text, effect="noted", value=strength)
    legs = legs_of(robot)
    poses = Kinematics(robot).forward(course.root_pos_w, course.root_quat_w, clip.joint_pos)
    lowered = np.array([0.0, 0.0, -_lowering(gait, course, poses, legs)])
    joint_pos = clip.joint_pos.copy()
    for side, leg in enumerate(legs):
        foot = int(leg.links[-1])
        found = reach(
            robot.tree,
            leg,
            (poses.pos_w[:, leg.base] + lowered, poses.quat_w[:, leg.base]),
            (gait.poses.pos_w[:, foot] + course.foot_offset_w[:, side], gait.poses.quat_w[:, foot]),
            clip.joint_pos[:, leg.joints],
        )
        within = within_limits(clip, robot, leg, gait.contacts[:, side], found)
        if isinstance(within, Reason):
            return within
        joint_pos[:, leg.joints] = within
    root_pos_w = course.root_pos_w + lowered
    return dataclasses.replace(
        clip, name=name, root_pos_w=root_pos_w, root_quat_w=course.root_quat_w, joint_pos=joint_pos
    )


def _lowering(gait: Gait, course: Course, poses: LinkPoses, legs: tuple[Leg, Leg]) -> float:
    """Constant lowering of the root [m] for which no leg is stretched more than in the original.

    Zero if no leg is stretched more, `MOST_LOWERED` if that is not enough.
    """
    needed = 0.0
    for side, leg in enumerate(legs):
        hip, foot = int(leg.links[0]), int(leg.links[-1])
        before = gait.poses.pos_w[:, hip] - gait.poses.pos_w[:, foot]
        longest = float(rotation.length(before).max())
        now = poses.pos_w[:, hip] - gait.poses.pos_w[:, foot] - course.foot_offset_w[:, side]
        aside = np.hypot(now[:, 0], now[:, 1])
        if aside.max() >= longest:
            return MOST_LOWERED
        needed = max(needed, float(np.max(now[:, 2] - np.sqrt(longest**2 - aside**2))))
    return min(needed, MOST_LOWERED)


def gait_of(clip: RobotClip, robot: Robot, contact: ContactSettings) -> Gait:
    """Measure the gait of a clip; contacts are the clip's labels, or inferred from its soles with `contact`."""
    kinematics = Kinematics(robot)
    poses = kinematics.forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    hips = [int(leg.links[0]) for leg in legs_of(robot)]
    sole = sole_motion(clip, robot)
    return Gait(
        clip=clip,
        poses=poses,
        contacts=contact_from_sole(sole, contact) if clip.contacts is None else clip.contacts,
        foot_pos_w=kinematics.site_pos_w(poses, robot.feet),
        clearance=sole.height,
        hips_w=poses.pos_w[:, hips].mean(axis=1),
        heading=_steady(np.unwrap(rotation.yaw_of(clip.root_quat_w)), clip.fps),
    )


def _steady(angle: Float[np.ndarray, " t"], fps: float) -> Float[np.ndarray, " t"]:
    """Mean over a stride around each frame. The straight line between the ends is subtracted first and added again,
    because the window shrinks at the ends, which would bias a continuous turn."""
    line = np.linspace(angle[0], angle[-1], len(angle))
    return line + time_series.moving_mean(angle - line, 2 * round(STRIDE_S * fps / 2.0) + 1)


def _step_length(gait: Gait, factor: float) -> Course:
    """Scale the root's path and each foot's position along it, in front of and behind the root."""
    root = gait.clip.root_pos_w
    more = (factor - 1.0) * (root - root[0]) * [1.0, 1.0, 0.0]

    def offset_at(side: int, frame: int) -> np.ndarray:
        before_root = gait.foot_pos_w[frame, side] - root[frame]
        return more[frame] + (factor - 1.0) * _along(gait, frame, before_root)

    return _course(gait, offset_at, root_offset_w=more)


def _along(gait: Gait, frame: int, vector: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
    """Component of a vector along the root's direction of travel at a frame; smaller where the root hardly moves."""
    root, half = gait.clip.root_pos_w, round(STRIDE_S * gait.clip.fps / 2.0)
    first, last = max(frame - half, 0), min(frame + half, len(root) - 1)
    velocity = (root[last] - root[first]) * [1.0, 1.0, 0.0] * gait.clip.fps / max(last - first, 1)
    return velocity * (velocity @ vector) / (velocity @ velocity + WALKING_M_S**2)


def _step_width(gait: Gait, more: float) -> Course:
    """Move each foot outward by half of `more` [m], along the lateral axis of each stance's heading."""

    def offset_at(side: int, frame: int) -> np.ndarray:
        yaw = float(gait.heading[frame])
        return (0.5 - side) * more * np.array([-np.sin(yaw), np.cos(yaw), 0.0])

    return _course(gait, offset_at)


def _foot_lift(gait: Gait, more: float) -> Course:
    course = _course(gait, lambda side, frame: np.zeros(3))
    for side in range(2):
        lift = lift_in_swings(gait.contacts[:, side], gait.clearance[:, side], gait.clip.fps)
        course.foot_offset_w[:, side, 2] = more * lift
    return course


def _trunk_lean(gait: Gait, lean_deg: float) -> Course:
    """Rotate the root about the lateral axis through the hips, whose positions do not change."""
    course = _course(gait, lambda side, frame: np.zeros(3))
    lateral = np.stack([-np.sin(gait.heading), np.cos(gait.heading), np.zeros_like(gait.heading)], axis=1)
    turn = rotation.from_rotvec(np.radians(lean_deg) * lateral)
    root_pos_w = gait.hips_w + rotation.rotate(turn, gait.clip.root_pos_w - gait.hips_w)
    root_quat_w = rotation.multiply(turn, gait.clip.root_quat_w)
    return dataclasses.replace(course, root_pos_w=root_pos_w, root_quat_w=rotation.make_continuous(root_quat_w))


_COURSES: dict[str, Callable[[Gait, float], Course]] = {
    "step_length": _step_length,
    "step_width": _step_width,
    "foot_lift": _foot_lift,
    "trunk_lean": _trunk_lean,
}


def _course(
    gait: Gait,
    offset_at: Callable[[int, int], Float[np.ndarray, " 3"]],
    root_offset_w: Float[np.ndarray, "t 3"] | float = 0.0,
) -> Course:
    """The original's targets with an offset for each foothold and for the root."""
    feet = [offset_by_stance(gait.contacts[:, side], partial(offset_at, side)) for side in range(2)]
    return Course(
        root_pos_w=gait.clip.root_pos_w + root_offset_w,
        root_quat_w=gait.clip.root_quat_w,
        foot_offset_w=np.stack(feet, axis=1),
    )


def _nothing_changed(gait: Gait, course: Course) -> bool:
    moved = max(np.abs(course.foot_offset_w).max(), np.abs(course.root_pos_w - gait.clip.root_pos_w).max())
    turned = np.max(rotation.angle_between(gait.clip.root_quat_w, course.root_quat_w))
    return bool(moved < LEAST_CHANGE and turned < LEAST_LEAN)
