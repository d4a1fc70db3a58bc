"""The kinematic tree as arrays, with forward kinematics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pipeline import rotation


@dataclass(frozen=True, kw_only=True)
class Tree:
    """L links, parents before children; link 0 is the root. Every other link has one hinge joint."""

    link_names: tuple[str, ...]
    parent: Int[np.ndarray, " l"]
    """Index of each link's parent; -1 for the root."""
    joint: Int[np.ndarray, " l"]
    """Index of each link's joint in the robot's joint order; -1 for the root."""
    pos: Float[np.ndarray, "l 3"]
    """Joint frame in the parent's frame, position [m]."""
    quat: Float[np.ndarray, "l 4"]
    """Joint frame in the parent's frame, orientation wxyz."""
    axis: Float[np.ndarray, "l 3"]
    """Joint axis in the joint frame, unit; zero for the root."""
    site_names: tuple[str, ...]
    site_link: Int[np.ndarray, " s"]
    """Index of the link that each site is fixed to."""
    site_pos: Float[np.ndarray, "s 3"]
    """Position of each site in its link's frame [m]."""

    def joint_axes_root(self) -> Float[np.ndarray, "j 3"]:
        """Axis of each joint in the root frame, all joints at zero, in the robot's joint order."""
        count = len(self.link_names) - 1
        _, quat = forward(self, np.zeros((1, 3)), rotation.IDENTITY[None], np.zeros((1, count)))
        axes = np.zeros((count, 3))
        axes[self.joint[1:]] = rotation.rotate(quat[0, 1:], self.axis[1:])
        return axes


def forward(
    tree: Tree,
    root_pos_w: Float[np.ndarray, "t 3"],
    root_quat_w: Float[np.ndarray, "t 4"],
    joint_pos: Float[np.ndarray, "t j"],
) -> tuple[Float[np.ndarray, "t l 3"], Float[np.ndarray, "t l 4"]]:
    """Positions [m] and orientations (wxyz) of all links, world frame; joint positions in rad."""
    pos, quat = [root_pos_w], [root_quat_w]
    angles = joint_pos[:, tree.joint[1:]].T.copy()  # contiguous frames per link: twice as fast
    turns = rotation.from_axis_angle(tree.axis[1:, None], angles)
    in_parent = rotation.multiply(tree.quat[1:, None], turns)
    for link in range(1, len(tree.link_names)):
        parent = tree.parent[link]
        pos.append(pos[parent] + rotation.rotate(quat[parent], tree.pos[link]))
        quat.append(rotation.multiply(quat[parent], in_parent[link - 1]))
    return np.stack(pos, axis=1), np.stack(quat, axis=1)
