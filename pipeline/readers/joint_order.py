"""The order of joints without names: the robot's own, or breadth first as Isaac Lab writes them.

Where an archive holds positions of bodies they prove it: every link has to be where our kinematics puts it.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from pipeline.clips.outcome import Reason
from pipeline.robot import Kinematics, Robot

MAX_LINK_ERROR = 0.05
"""How far the links of our model may lie from the file's bodies [m], median over frames."""

FRAMES = 20
"""Frames that are compared, evenly over the motion."""

LIMIT_MARGIN = 0.3
"""A joint this far beyond its limits [rad] shows another joint's angle, or another robot's."""

BEYOND = 0.1
"""Share of the frames in which a joint without a name may be beyond its limits."""


def breadth_first(robot: Robot) -> list[int]:
    """Where in a breadth-first order each joint of the robot is, in the robot's order."""
    tree = robot.tree
    depth = np.zeros(len(tree.link_names), dtype=int)
    for link in range(1, len(depth)):
        depth[link] = depth[tree.parent[link]] + 1
    links = sorted(range(1, len(depth)), key=lambda link: (depth[link], link))
    order = [int(tree.joint[link]) for link in links]
    return [order.index(joint) for joint in range(len(order))]


def link_errors(
    robot: Robot,
    root_pos_w: Float[np.ndarray, "t 3"],
    root_quat_w: Float[np.ndarray, "t 4"],
    joint_pos: Float[np.ndarray, "t j"],
    body_pos_w: Float[np.ndarray, "t b 3"],
) -> Float[np.ndarray, " l"] | None:
    """Distance of each of our links to the nearest body of the file [m], median over frames.

    None where no frame is complete.
    """
    count = len(root_pos_w)
    arrays = (root_pos_w, root_quat_w, joint_pos, body_pos_w.reshape(count, -1))
    complete = np.flatnonzero(np.isfinite(np.concatenate(arrays, axis=1)).all(axis=1))
    if not len(complete):
        return None
    frames = np.unique(complete[np.linspace(0, len(complete) - 1, FRAMES).astype(int)])
    poses = Kinematics(robot).forward(root_pos_w[frames], root_quat_w[frames], joint_pos[frames])
    gaps = np.linalg.norm(poses.pos_w[:, :, None] - body_pos_w[frames][:, None], axis=-1).min(axis=2)
    return np.median(gaps, axis=0)


def beyond_limits(robot: Robot, joint_pos: Float[np.ndarray, "t j"]) -> tuple[str, float] | None:
    """The joint that is beyond its limits in most frames and in which share of them; None where none is in many."""
    over = (joint_pos > robot.joint_upper + LIMIT_MARGIN) | (joint_pos < robot.joint_lower - LIMIT_MARGIN)
    share = over.mean(axis=0)
    worst = int(share.argmax())
    return (robot.joint_names[worst], float(share[worst])) if share[worst] > BEYOND else None


def taken_joint_order(robot: Robot) -> Reason:
    """The note of a file whose joints are breadth first."""
    text = (
        f"its joints have no names; in {robot.name}'s own order its links would lie elsewhere than the file's bodies, "
        "breadth first (as Isaac Lab orders them) they are where the file has them, which is taken"
    )
    return Reason(code="joint_order", text=text, effect="noted")


def taken_quaternion_order(order: str) -> Reason:
    """The note of a file whose root's quaternion is in another order than its format's."""
    text = f"the root's quaternion is {order}, not as this format has it: so its links are where the file's bodies are"
    return Reason(code="quaternion_order", text=text, effect="noted")
