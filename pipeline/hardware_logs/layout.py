"""Which robot a log is of, by the number of its joints, and what its joints may do."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline.robot import Robot


@dataclass(frozen=True, kw_only=True)
class Layout:
    """A robot's serial joints in the order of its arrays."""

    robot: str
    joint_names: tuple[str, ...]
    joint_lower: Float[np.ndarray, " j"]
    """[rad]"""
    joint_upper: Float[np.ndarray, " j"]
    """[rad]"""
    speed_limit: Float[np.ndarray, " j"]
    """[rad/s]"""


_ARM = ("Shoulder_Pitch", "Shoulder_Roll", "Elbow_Pitch", "Elbow_Yaw")
_LEG = ("Hip_Pitch", "Hip_Roll", "Hip_Yaw", "Knee_Pitch", "Ankle_Pitch", "Ankle_Roll")
_LEG_LIMITS = ((-3.0, 2.21, 8.0), (-0.4, 1.57, 12.9), (-1.0, 1.0, 18.0), (0.0, 2.23, 12.5), (-0.87, 0.345, 18.0))


def _k1() -> Layout:
    names, limits = ["AAHead_yaw", "Head_pitch"], [(-1.0, 1.0, 20.0), (-0.349, 0.855, 20.0)]
    arm = ((-3.316, 1.22, 18.0), (-1.74, 1.57, 18.0), (-2.27, 2.27, 18.0), (-2.44, 0.0, 18.0))
    leg = (*_LEG_LIMITS, (-0.345, 0.345, 18.0))
    for parts, each in ((_ARM, arm), (_LEG, leg)):
        for side, sign in (("Left", 1), ("Right", -1)):
            letter = "A" if parts is _ARM else ""
            names += [f"{letter if part == 'Shoulder_Pitch' else ''}{side}_{part}" for part in parts]
            limits += [_side(part, limit, sign) for part, limit in zip(parts, each, strict=True)]
    lower, upper, speed = np.array(limits).T
    return Layout(robot="k1", joint_names=tuple(names), joint_lower=lower, joint_upper=upper, speed_limit=speed)


def _side(part: str, limit: tuple[float, float, float], sign: int) -> tuple[float, float, float]:
    """Limits of the right side: those of roll and of the elbow's yaw are mirrored."""
    low, high, speed = limit
    mirrored = sign < 0 and part in ("Shoulder_Roll", "Hip_Roll", "Elbow_Yaw")
    return (-high, -low, speed) if mirrored else (low, high, speed)


K1 = _k1()
"""From the published model; a robot folder of that name takes its place."""


def layout_of(robot: Robot) -> Layout:
    return Layout(
        robot=robot.name,
        joint_names=robot.joint_names,
        joint_lower=robot.joint_lower,
        joint_upper=robot.joint_upper,
        speed_limit=robot.motor_speed_limit,
    )


def layouts(robots: Iterable[Robot]) -> dict[int, Layout]:
    """Layouts by number of joints: those of the robots, and the K1's where it is not among them.

    Raises ValueError for two robots with as many joints: the robot of a log would be ambiguous.
    """
    found: dict[int, Layout] = {}
    for each in map(layout_of, robots):
        count = len(each.joint_names)
        if count in found:
            raise ValueError(f"'{found[count].robot}' and '{each.robot}' both have {count} joints.")
        found[count] = each
    return {len(K1.joint_names): K1} | found
