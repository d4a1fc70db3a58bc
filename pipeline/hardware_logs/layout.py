"""Which robot a log is of, by the number of its joints, and what its joints may do."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pipeline.robot import Robot
from pipeline.robot.legs import legs_of


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
    ankles: Int[np.ndarray, " a"]
    """Indices of the joints whose motors work in parallel."""


def layout_of(robot: Robot) -> Layout:
    return Layout(
        robot=robot.name,
        joint_names=robot.joint_names,
        joint_lower=robot.joint_lower,
        joint_upper=robot.joint_upper,
        speed_limit=robot.motor_speed_limit,
        ankles=np.array(legs_of(robot).all_ankles, dtype=np.int64),
    )


def layouts(robots: Iterable[Robot]) -> dict[int, tuple[Layout, ...]]:
    """Layouts of robots by number of joints. Where several robots have as many, a log must state its robot."""
    found: dict[int, tuple[Layout, ...]] = {}
    for each in map(layout_of, robots):
        count = len(each.joint_names)
        found[count] = (*found.get(count, ()), each)
    return found
