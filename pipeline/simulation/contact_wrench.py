"""Is there a contact force that explains a motion within the torque limits?

At each frame forces act at the corners of the soles, each within a friction pyramid (so the ground only
pushes, and the centre of pressure lies inside the soles). They must add up to the wrench the motion needs at
the root, and they turn the torques "nothing touches" into the torques the motors must give. A motion made
without physics is never explained exactly, so the question is a least-squares one:

    min  |root residual / weight|^2 + e^2 sum_j (torque_j / limit_j)^2          over forces in the pyramids

with a small e: first the root, then little torque. Where some torque is past its limit there, only the torque
past the limits counts, and the problem is solved again with the joints that are past theirs:

    min  |root residual / weight|^2 + w^2 sum_j (max(|torque_j| - limit_j, 0) / limit_j)^2

by Newton steps over the set of these joints. Both are non-negative least squares (Lawson and Hanson 1974).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.optimize import nnls

from pipeline import rotation
from pipeline.robot import Robot
from pipeline.simulation.inverse_dynamics import MotionForces

GRAVITY = 9.81
"""[m/s^2], that of the MuJoCo models."""

LEVER = 0.1
"""Length [m] that makes a moment comparable to a force: about the half length of a sole."""

TORQUE_WEIGHT = 0.01
"""e above: 1 % of the limits' torque costs as much as a root residual of .02 % of the weight."""

TIE_WEIGHT = 1e-4
"""e in the second problem, which only decides between forces that are equally good."""

NEWTON_STEPS = 8


@dataclass(frozen=True, kw_only=True)
class ContactSolution:
    """The best admissible contact forces of T frames and what they leave."""

    force_w: Float[np.ndarray, "t c 3"]
    """At each sole corner, world frame [N]; 0 at corners that may not touch."""
    joint_torque: Float[np.ndarray, "t j"]
    """What the motors must give [N m]."""
    residual_w: Float[np.ndarray, "t 6"]
    """Force [N] and moment about the point of the ground below the root [N m] that no admissible contact
    supplies, world frame. The horizontal moment over the weight is how far outside the soles the centre of
    pressure would have to lie."""


def solve_contacts(
    robot: Robot,
    forces: MotionForces,
    root_pos_w: Float[np.ndarray, "t 3"],
    corner_pos_w: Float[np.ndarray, "t 2 4 3"],
    touching: Bool[np.ndarray, "t 2 4"],
    *,
    friction: float,
    excess_weight: float,
    heading: Float[np.ndarray, " t"] | None = None,
    torque_limit: Float[np.ndarray, " j"] | None = None,
) -> ContactSolution:
    """Contact forces at the corners that are `touching`, with the coefficient of friction `friction`.

    Friction pyramids have four sides and lie inside the cones; `heading` [rad] turns them with the robot, so that
    the result does not depend on where it faces. `excess_weight` is what torque past a limit costs against the root
    (w above). `torque_limit` [N m] replaces the robot's.
    """
    count = len(root_pos_w)
    limit = robot.torque_limit if torque_limit is None else torque_limit
    corners = corner_pos_w.reshape(count, 8, 3)
    allowed = touching.reshape(count, 8)
    legs, moved = _moved_joints(robot)
    below_root_w = root_pos_w * np.array([1.0, 1.0, 0.0])
    maps = _force_maps(forces, below_root_w, corners, legs, moved)
    turns = rotation.about_z(np.zeros(count) if heading is None else heading)
    edges = rotation.rotate(turns[:, None], _pyramid(friction))
    columns = np.einsum("tkcx,tex->tkce", maps, edges)
    weight = robot.total_mass * GRAVITY
    root_scale = 1.0 / (weight * np.array([1.0, 1.0, 1.0, LEVER, LEVER, LEVER]))
    wrench_w = _moved_to(forces.root_wrench_w, root_pos_w, below_root_w)
    needed = np.concatenate([wrench_w * root_scale, forces.joint_torque[:, legs] / limit[legs]], axis=1)
    columns[:, :6] *= root_scale[:, None, None]
    columns[:, 6:] *= 1.0 / limit[legs][:, None, None]
    strength = np.zeros((count, 8, edges.shape[1]))
    for frame in np.flatnonzero(allowed.any(axis=1)):
        open_corners = allowed[frame]
        matrix = columns[frame][:, open_corners].reshape(len(needed[frame]), -1)
        strength[frame, open_corners] = _solve(matrix, needed[frame], excess_weight).reshape(-1, edges.shape[1])
    force_w = np.einsum("tce,tex->tcx", strength, edges)
    supplied = np.einsum("tkcx,tcx->tk", maps, force_w)
    torque = forces.joint_torque.copy()
    torque[:, legs] -= supplied[:, 6:]
    return ContactSolution(force_w=force_w, joint_torque=torque, residual_w=wrench_w - supplied[:, :6])


def _solve(matrix: np.ndarray, needed: np.ndarray, excess_weight: float) -> np.ndarray:
    """Strengths of the pyramid edges for one frame; the first six rows are the root's, the others joints over limit."""
    weights = np.full(len(needed), TORQUE_WEIGHT)
    weights[:6] = 1.0
    strength = nnls(matrix * weights[:, None], needed * weights)[0]
    best, best_cost = strength, _cost(matrix, needed, strength, excess_weight)
    past: np.ndarray | None = None
    for _ in range(NEWTON_STEPS):
        left = needed - matrix @ strength
        now = np.abs(left[6:]) > 1.0
        if not now.any() or (past is not None and np.array_equal(now, past)):
            break
        past = now
        weights[6:] = np.where(now, excess_weight, TIE_WEIGHT)
        aim = needed.copy()
        aim[6:] -= np.where(now, np.sign(left[6:]), 0.0)
        strength = nnls(matrix * weights[:, None], aim * weights)[0]
        cost = _cost(matrix, needed, strength, excess_weight)
        if cost < best_cost:
            best, best_cost = strength, cost
    return best


def _cost(matrix: np.ndarray, needed: np.ndarray, strength: np.ndarray, excess_weight: float) -> float:
    left = needed - matrix @ strength
    excess = np.maximum(np.abs(left[6:]) - 1.0, 0.0)
    return float(left[:6] @ left[:6] + excess_weight**2 * (excess @ excess))


def _force_maps(
    forces: MotionForces, about_w: np.ndarray, corners: np.ndarray, legs: np.ndarray, moved: np.ndarray
) -> Float[np.ndarray, "t k c 3"]:
    """What a force at each corner supplies: force, moment about `about_w`, torque at each leg joint."""
    count = len(corners)
    maps = np.zeros((count, 6 + len(legs), 8, 3))
    maps[:, [0, 1, 2], :, [0, 1, 2]] = 1.0
    maps[:, 3:6] = np.moveaxis(_cross_matrix(corners - about_w[:, None]), 1, 2)
    arms = corners[:, None] - forces.joint_anchor_w[:, legs, None]
    torque_rows = np.cross(forces.joint_axis_w[:, legs, None], arms)
    maps[:, 6:] = torque_rows * moved[None, :, :, None]
    return maps


def _moved_to(wrench: np.ndarray, origin: np.ndarray, point: np.ndarray) -> np.ndarray:
    """A wrench (t, 6) about `origin` (t, 3) as one about `point` (t, 3)."""
    force, moment = wrench[:, :3], wrench[:, 3:]
    return np.concatenate([force, moment + np.cross(origin - point, force)], axis=1)


def _cross_matrix(vectors: np.ndarray) -> np.ndarray:
    """(t, c, 3) to (t, c, 3, 3) with matrix @ f = vector x f."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _pyramid(friction: float) -> Float[np.ndarray, "4 3"]:
    """Edges of a four-sided pyramid inside the friction cone about z."""
    side = friction / np.sqrt(2.0)
    return np.array([[side, side, 1.0], [side, -side, 1.0], [-side, side, 1.0], [-side, -side, 1.0]])


def _moved_joints(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Joints that carry a foot, and which corner (8) each of them moves."""
    tree = robot.tree
    moved = np.zeros((len(robot.joint_names), 8))
    for side, foot in enumerate(robot.feet):
        link = int(tree.site_link[robot.site(foot)])
        while link > 0:
            moved[tree.joint[link], 4 * side : 4 * side + 4] = 1.0
            link = int(tree.parent[link])
    legs = np.flatnonzero(moved.any(axis=1))
    return legs, moved[legs]
