"""Vectorized forward kinematics of a robot in numpy."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.errors import UnknownNameError
from pipeline.robot.robot import Robot, forward


def mujoco_model(robot: Robot, ground: bool = False, timestep: float = 0.005) -> mujoco.MjModel:
    """The robot's MuJoCo model: armature in, no actuators.

    `qpos` is the root's position [m] and quaternion (wxyz), then the joints in the robot's order; body
    1 + i is link i.

    Args:
        robot: the robot
        ground: add a plane `ground` at z = 0
        timestep: timestep of the simulation [s]
    """
    return compiled(robot.mjcf, ground, timestep)


def compiled(mjcf: str, ground: bool = False, timestep: float = 0.005) -> mujoco.MjModel:
    """The model of a robot's MJCF text; see `mujoco_model`."""
    spec = mujoco.MjSpec.from_string(mjcf)
    spec.option.timestep = timestep
    if ground:
        spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.05])
    return spec.compile()


@dataclass(frozen=True, kw_only=True)
class LinkPoses:
    """Poses of all links over t frames; links in the order of `Robot.link_names`."""

    pos_w: Float[np.ndarray, "t l 3"]
    """Origins of the link frames, world frame [m]."""
    quat_w: Float[np.ndarray, "t l 4"]
    """Orientations of the link frames, world frame, wxyz."""


class Kinematics:
    """Poses of a robot's links and sites."""

    def __init__(self, robot: Robot):
        self._tree = robot.tree
        self._site = {name: index for index, name in enumerate(robot.tree.site_names)}

    def forward(
        self,
        root_pos_w: Float[np.ndarray, "t 3"],
        root_quat_w: Float[np.ndarray, "t 4"],
        joint_pos: Float[np.ndarray, "t j"],
    ) -> LinkPoses:
        """Poses of all links from the root's pose ([m], unit wxyz) and joint positions [rad]."""
        pos_w, quat_w = forward(self._tree, root_pos_w, root_quat_w, joint_pos)
        return LinkPoses(pos_w=pos_w, quat_w=quat_w)

    def link_pos_w(
        self,
        root_pos_w: Float[np.ndarray, "t 3"],
        root_quat_w: Float[np.ndarray, "t 4"],
        joint_pos: Float[np.ndarray, "t j"],
        link: int,
    ) -> Float[np.ndarray, "t 3"]:
        """Positions of one link's origin, world frame [m]; only the links between it and the root are computed."""
        tree = self._tree
        pos_w, quat_w = root_pos_w, root_quat_w
        for above, each in itertools.pairwise([0, *reversed(tree.chain(link))]):
            if above:
                turn = rotation.from_axis_angle(tree.axis[above], joint_pos[:, tree.joint[above]])
                quat_w = rotation.multiply(quat_w, rotation.multiply(tree.quat[above], turn))
            pos_w = pos_w + rotation.rotate(quat_w, tree.pos[each])
        return pos_w

    def site_pos_w(self, poses: LinkPoses, site_names: Sequence[str]) -> Float[np.ndarray, "t n 3"]:
        """Positions of the named sites, world frame [m]. Raises UnknownNameError."""
        for name in site_names:
            if name not in self._site:
                raise UnknownNameError("site", name, self._tree.site_names)
        index = [self._site[name] for name in site_names]
        link = self._tree.site_link[index]
        return poses.pos_w[:, link] + rotation.rotate(poses.quat_w[:, link], self._tree.site_pos[index])

    def sites_of_pose(
        self,
        site_names: Sequence[str],
        joint_pos: Float[np.ndarray, " j"],
        root_quat: Float[np.ndarray, " 4"] = rotation.IDENTITY,
    ) -> Float[np.ndarray, "n 3"]:
        """Positions [m] of the named sites in one pose with the root at the origin. Raises UnknownNameError."""
        poses = self.forward(np.zeros((1, 3)), root_quat[None], joint_pos[None])
        return self.site_pos_w(poses, site_names)[0]
