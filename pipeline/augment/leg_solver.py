"""Joints of a leg that put its foot where it is wanted, all frames at once: damped Newton steps from given joints.

Levenberg and Marquardt's damping, each frame with its own: it falls with every step that helps, so that steps become
Newton's and digits double, and rises where a leg is nearly straight and a full step would overshoot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pipeline import rotation
from pipeline.robot import Robot
from pipeline.robot.tree import Tree

TOLERANCE = 1e-6
"""A foot is where it is wanted if it misses its place [m] and its orientation [rad] by less."""

AIM = 1e-9
"""Steps end at this miss [m, rad]: a thousandth of the tolerance leaves no noise in accelerations."""

MOST_STEPS = 40
"""From joints of a few degrees away four or five are enough; a leg that is stretched out takes more."""

FIRST_DAMPING = 1e-4
"""[m^2] as J J^T, in which a leg's lever is about .5 m."""

LONGEST_STEP = 0.3
"""Of a joint [rad], so that no step leaves the branch that the leg is on."""


@dataclass(frozen=True, kw_only=True)
class Leg:
    """The joints from the hip of one side to its foot; links from the hip down, the foot last."""

    base: int
    """The link that the leg hangs on."""
    links: Int[np.ndarray, " n"]
    joints: Int[np.ndarray, " n"]


def legs_of(robot: Robot) -> tuple[Leg, Leg]:
    """The left and the right leg: what of the way from each foot to the root is not the other's too."""
    ways = [_way_up(robot.tree, int(robot.tree.site_link[robot.site(foot)])) for foot in robot.feet]
    legs = []
    for own, other in (ways, ways[::-1]):
        links = np.array([link for link in own if link not in other][::-1])
        legs.append(Leg(base=int(robot.tree.parent[links[0]]), links=links, joints=robot.tree.joint[links]))
    return legs[0], legs[1]


def _way_up(tree: Tree, link: int) -> list[int]:
    way = [link]
    while tree.parent[way[-1]] >= 0:
        way.append(int(tree.parent[way[-1]]))
    return way


@dataclass(frozen=True, kw_only=True)
class Reach:
    """What a leg does to follow its foot."""

    joint_pos: Float[np.ndarray, "t n"]
    """[rad]"""
    miss: Float[np.ndarray, " t"]
    """How far the foot is from where it is wanted, the larger of place [m] and orientation [rad]."""

    @property
    def reached(self) -> Bool[np.ndarray, " t"]:
        return self.miss < TOLERANCE


def reach(
    tree: Tree,
    leg: Leg,
    base: tuple[Float[np.ndarray, "t 3"], Float[np.ndarray, "t 4"]],
    foot: tuple[Float[np.ndarray, "t 3"], Float[np.ndarray, "t 4"]],
    joint_pos: Float[np.ndarray, "t n"],
) -> Reach:
    """Joints of a leg for poses (place [m], orientation wxyz) of what it hangs on and of its foot, world frame.

    Args:
        joint_pos: where the steps begin [rad]; the solution is the one that lies next to it. No limits are kept.
    """
    found = joint_pos.copy()
    error, jacobian = _error_and_jacobian(tree, leg, base, foot, found)
    damping = np.full(len(found), FIRST_DAMPING)
    for _ in range(MOST_STEPS):
        open_ = np.flatnonzero(_miss(error) > AIM)
        if not len(open_):
            break
        parts = tuple((pos[open_], quat[open_]) for pos, quat in (base, foot))
        tried = found[open_] + _step(jacobian[open_], error[open_], damping[open_])
        new_error, new_jacobian = _error_and_jacobian(tree, leg, parts[0], parts[1], tried)
        better = np.square(new_error).sum(axis=1) < np.square(error[open_]).sum(axis=1)
        kept = open_[better]
        found[kept], error[kept], jacobian[kept] = tried[better], new_error[better], new_jacobian[better]
        damping[open_] *= np.where(better, 0.01, 10.0)
    return Reach(joint_pos=found, miss=_miss(error))


def _step(
    jacobian: Float[np.ndarray, "t 6 n"], error: Float[np.ndarray, "t 6"], damping: Float[np.ndarray, " t"]
) -> Float[np.ndarray, "t n"]:
    transposed = np.swapaxes(jacobian, 1, 2)
    normal = transposed @ jacobian + damping[:, None, None] * np.eye(jacobian.shape[2])
    step = np.linalg.solve(normal, transposed @ error[..., None])[..., 0]
    longest = np.abs(step).max(axis=1, keepdims=True)
    return step * np.minimum(1.0, LONGEST_STEP / np.maximum(longest, LONGEST_STEP))


def _miss(error: Float[np.ndarray, "t 6"]) -> Float[np.ndarray, " t"]:
    return np.maximum(rotation.length(error[:, :3]), rotation.length(error[:, 3:]))


def _error_and_jacobian(
    tree: Tree,
    leg: Leg,
    base: tuple[Float[np.ndarray, "t 3"], Float[np.ndarray, "t 4"]],
    foot: tuple[Float[np.ndarray, "t 3"], Float[np.ndarray, "t 4"]],
    joint_pos: Float[np.ndarray, "t n"],
) -> tuple[Float[np.ndarray, "t 6"], Float[np.ndarray, "t 6 n"]]:
    """What the foot lacks (place, then rotation vector, world frame), and how each joint moves the foot."""
    pos, quat = base
    origins, axes = [], []
    for index, link in enumerate(leg.links):
        pos = pos + rotation.rotate(quat, tree.pos[link])
        frame = rotation.multiply(quat, tree.quat[link])
        origins.append(pos)
        axes.append(rotation.rotate(frame, tree.axis[link]))
        quat = rotation.multiply(frame, rotation.from_axis_angle(tree.axis[link], joint_pos[:, index]))
    turn = rotation.to_rotvec(rotation.multiply(foot[1], rotation.conjugate(quat)))
    axis, lever = np.stack(axes, axis=1), pos[:, None] - np.stack(origins, axis=1)
    jacobian = np.concatenate([rotation.cross(axis, lever), axis], axis=2)
    return np.concatenate([foot[0] - pos, turn], axis=1), np.swapaxes(jacobian, 1, 2)
