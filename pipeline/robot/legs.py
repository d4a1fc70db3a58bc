"""The joints of the legs, from the human correspondence and the tree; names do not matter."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.robot.description import SIDES
from pipeline.robot.robot import Robot

LATERAL = 0.9
"""Least component along y of the axis of a joint that pitches."""


@dataclass(frozen=True, kw_only=True)
class Legs:
    """Indices of joints; pairs are (left, right)."""

    joints: tuple[tuple[int, ...], tuple[int, ...]]
    """From the pelvis to the foot."""
    hip_pitch: tuple[int, int]
    knee: tuple[int, int]
    ankles: tuple[tuple[int, ...], tuple[int, ...]]
    """Joints beyond the shank."""

    @property
    def all(self) -> tuple[int, ...]:
        """Joints of both legs in the robot's order."""
        return tuple(sorted((*self.joints[0], *self.joints[1])))

    @property
    def all_ankles(self) -> tuple[int, ...]:
        """Ankle joints of both legs in the robot's order."""
        return tuple(sorted((*self.ankles[0], *self.ankles[1])))


def legs_of(robot: Robot) -> Legs:
    """The legs of a robot. A hip without a pitching joint has its first joint in its place."""
    axes = robot.tree.joint_axes_root()
    joints, hips, knees, ankles = [], [], [], []
    for side in SIDES:
        chain = _chain(robot, robot.link(robot.human["pelvis"]), robot.link(robot.human[f"{side}_foot"]))
        knee = int(robot.tree.joint[robot.link(robot.human[f"{side}_shank"])])
        place = chain.index(knee)
        pitching = [joint for joint in chain[:place] if abs(axes[joint, 1]) > LATERAL]
        joints.append(chain)
        hips.append((pitching or chain)[0])
        knees.append(knee)
        ankles.append(chain[place + 1 :])
    return Legs(
        joints=(joints[0], joints[1]),
        hip_pitch=(hips[0], hips[1]),
        knee=(knees[0], knees[1]),
        ankles=(ankles[0], ankles[1]),
    )


def _chain(robot: Robot, top: int, foot: int) -> tuple[int, ...]:
    """Joints from below `top` to `foot`."""
    found, link = [], foot
    while link not in (top, -1):
        found.append(int(robot.tree.joint[link]))
        link = int(robot.tree.parent[link])
    return tuple(reversed(found))
