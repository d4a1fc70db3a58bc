"""The leg joints, from the human correspondence and the tree, independent of names."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pipeline.robot.description import SIDES
from pipeline.robot.robot import Robot

AXIS_TOLERANCE = 0.01
"""Largest distance between a mirrored joint axis and its partner's axis (0.6 degrees)."""


def mirrored_name(name: str, pairs: Sequence[tuple[str, str]]) -> str:
    """`name` with each part of `pairs` replaced by its partner."""
    swap = {piece: other for left, right in pairs for piece, other in ((left, right), (right, left))}
    if not swap:
        return name
    pattern = "|".join(re.escape(piece) for piece in sorted(swap, key=len, reverse=True))
    return re.sub(pattern, lambda match: swap[match.group()], name)


def mirror_index(names: Sequence[str], pairs: Sequence[tuple[str, str]]) -> Int[np.ndarray, " n"]:
    """Index of each name's mirror partner; a name on the sagittal plane is its own partner."""
    return np.array([names.index(mirrored_name(name, pairs)) for name in names])


def mirror_sign(axis_root: Float[np.ndarray, "n 3"], index: Int[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Sign of the partner's position in the mirrored pose: +1 or -1, or 0 if the axes are not mirror images.

    An axis of rotation is a pseudovector: reflection in the x-z plane takes (x, y, z) to (-x, y, -z).

    Args:
        axis_root: joint axes in the root frame, all joints at zero
        index: each joint's partner
    """
    image = axis_root[index] * np.array([-1.0, 1.0, -1.0])
    same = np.linalg.norm(axis_root - image, axis=-1) < AXIS_TOLERANCE
    opposite = np.linalg.norm(axis_root + image, axis=-1) < AXIS_TOLERANCE
    return np.where(same, 1.0, np.where(opposite, -1.0, 0.0))


LATERAL = 0.9
"""Least y component of a pitch joint's axis."""


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
    """The legs of a robot. For a hip without a pitch joint, its first joint is used."""
    axes = robot.tree.joint_axes_root()
    joints, hips, knees, ankles = [], [], [], []
    for side in SIDES:
        above = robot.tree.chain(robot.link(robot.human["pelvis"]))
        links = [link for link in robot.tree.chain(robot.link(robot.human[f"{side}_foot"])) if link not in above]
        chain = tuple(int(robot.tree.joint[link]) for link in reversed(links))
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
