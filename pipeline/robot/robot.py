"""A robot as plain arrays and text, picklable for worker processes; its kinematic tree with forward kinematics."""

import dataclasses
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import UnknownNameError

FRAMES_AT_A_TIME = 160
"""Frames per batch, whose arrays fit in the processor's cache."""


@dataclass(frozen=True, kw_only=True)
class Tree:
    """Kinematic tree of l links, parents before children; link 0 is the root. Every other link has one hinge joint."""

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

    def chain(self, link: int) -> list[int]:
        """A link and its ancestors, without the root link."""
        found = []
        while link > 0:
            found.append(link)
            link = int(self.parent[link])
        return found

    @cached_property
    def by_level(self) -> tuple[Int[np.ndarray, " l"], tuple[slice, ...]]:
        """Links sorted by depth (number of joints to the root), and the slices of depths 1, 2, ... in that order."""
        depth = np.zeros(len(self.parent), dtype=int)
        for link in range(1, len(depth)):
            depth[link] = depth[self.parent[link]] + 1
        stops = np.cumsum(np.bincount(depth)).tolist()
        return np.argsort(depth, kind="stable"), tuple(itertools.starmap(slice, itertools.pairwise(stops)))

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
    """Positions [m] and orientations (wxyz) of all links, world frame; joint positions in rad.

    Computed on arrays (component, link, frame), FRAMES_AT_A_TIME frames at a time: numpy is fastest on long arrays that
    fit in the processor's cache.
    """
    frames, links = len(joint_pos), len(tree.parent)
    pos_w, quat_w = np.empty((frames, links, 3)), np.empty((frames, links, 4))
    parts = -(-frames // FRAMES_AT_A_TIME)
    for start, stop in itertools.pairwise(frames * part // parts for part in range(parts + 1) if parts):
        few = slice(start, stop)
        _forward(tree, root_pos_w[few], root_quat_w[few], joint_pos[few], pos_w[few], quat_w[few])
    return pos_w, quat_w


def _forward(
    tree: Tree,
    root_pos_w: Float[np.ndarray, "t 3"],
    root_quat_w: Float[np.ndarray, "t 4"],
    joint_pos: Float[np.ndarray, "t j"],
    pos_w: Float[np.ndarray, "t l 3"],
    quat_w: Float[np.ndarray, "t l 4"],
) -> None:
    """Write the result of `forward` into `pos_w` and `quat_w`; inside, links are in the order of `Tree.by_level`."""
    order, levels = tree.by_level
    place = np.argsort(order)
    parent = place[tree.parent[order]]
    pos, quat = (np.empty((parts, *quat_w.shape[1::-1])) for parts in (3, 4))
    pos[:, 0], quat[:, 0] = root_pos_w.T, root_quat_w.T
    half = np.zeros(quat.shape[1:])
    half[1:] = joint_pos.T[tree.joint[order[1:]]] / 2.0
    turns = np.concatenate([np.cos(half)[None], np.sin(half) * tree.axis[order].T[:, :, None]])
    in_parent = rotation.factors(rotation.product(tree.quat[order].T[:, :, None], rotation.factors(turns)))
    for links in levels:
        quat[:, links] = rotation.product(quat[:, parent[links]], in_parent[:, :, links])
    from_parent_w = rotation.rotate_parts(quat[:, parent], tree.pos[order].T[:, :, None])
    for links in levels:
        pos[:, links] = pos[:, parent[links]] + from_parent_w[:, links]
    pos_w[:], quat_w[:] = pos[:, place].transpose(2, 1, 0), quat[:, place].transpose(2, 1, 0)


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A humanoid with J hinge joints, read from its folder in `robots/`. Pairs are (left, right)."""

    name: str
    digest: str
    """SHA-256 of the contents of the folder's model files."""
    mjcf: str
    """The MuJoCo model as text: no ground, actuators, sensors or lights."""
    urdf: str
    """The URDF as text; each site is a fixed link of its name."""
    tree: Tree
    """Kinematic tree and sites."""
    total_mass: float
    """[kg]"""

    joint_names: tuple[str, ...]
    """The J joints in hardware order, the order of every array below and of every clip."""
    controlled: tuple[str, ...]
    """Joints that a policy moves; the others hold their default position."""
    joint_lower: Float[np.ndarray, " j"]
    """Lower position limits [rad]."""
    joint_upper: Float[np.ndarray, " j"]
    """Upper position limits [rad]."""
    retarget_speed_limit: Float[np.ndarray, " j"]
    """Speed that a retargeted motion may use [rad/s]: the smaller of the model's and the motor's."""
    motor_speed_limit: Float[np.ndarray, " j"]
    """Speed limit of the motors [rad/s]."""
    torque_limit: Float[np.ndarray, " j"]
    """[N m]"""
    armature: Float[np.ndarray, " j"]
    """Rotor inertia reflected to the joint [kg m^2]."""
    kp: Float[np.ndarray, " j"]
    """Stiffness of the joint controller [N m/rad]."""
    kd: Float[np.ndarray, " j"]
    """Damping of the joint controller [N m s/rad]."""
    default_joint_pos: Float[np.ndarray, " j"]
    """The default pose [rad]."""
    default_root_height: float
    """Height [m] of the root link's origin in the default pose with the soles on the ground."""

    mirror_index: Int[np.ndarray, " j"]
    """Each joint's partner in the mirror image; see `mirror_sign`."""
    mirror_sign: Float[np.ndarray, " j"]
    """+1 or -1: the mirrored pose is `mirror_sign * q[mirror_index]`."""
    link_mirror_index: Int[np.ndarray, " l"]
    """Each link's partner in the mirror image."""

    hands: tuple[str, str]
    """Sites at the ends of the arms."""
    feet: tuple[str, str]
    """Sites at the centres of the soles."""
    sole_corners: tuple[tuple[str, str, str, str], tuple[str, str, str, str]]
    """Sites at the corners of the soles, in order around each sole."""
    key_links: tuple[str, ...]
    """Links whose pose is used by tracking rewards and the discriminator."""
    human: dict[str, str]
    """Part of a person to the link or site that represents it: for `trunk, pelvis` and, with `left_` or `right_` before
    it, `thigh, shank, foot, upper_arm, forearm` a link; for `left_/right_` with `hip, knee, ankle,
    shoulder, elbow, wrist` a site."""
    namings: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """Names of the joints, in their order, by other naming."""

    @property
    def link_names(self) -> tuple[str, ...]:
        """All links, the root first, parents before children."""
        return self.tree.link_names

    @property
    def root_link(self) -> str:
        return self.tree.link_names[0]

    @cached_property
    def breadth_first(self) -> tuple[str, ...]:
        """The joints level by level of the kinematic tree, each level in the order of its links.

        Isaac Sim and Booster's published policies use this order.
        """
        level, links = [0], []
        while level:
            level = [link for parent in level for link in np.flatnonzero(self.tree.parent == parent)]
            links += level
        return tuple(self.joint_names[self.tree.joint[link]] for link in links)

    @property
    def policy_joints(self) -> tuple[str, ...]:
        """The controlled joints, breadth first."""
        return tuple(name for name in self.breadth_first if name in self.controlled)

    @property
    def site_names(self) -> tuple[str, ...]:
        return self.tree.site_names

    @property
    def controlled_index(self) -> Int[np.ndarray, " c"]:
        """Indices of the controlled joints in `joint_names`."""
        return np.array([self.joint(name) for name in self.controlled])

    @cached_property
    def leg_length(self) -> float:
        """Hip to knee, knee to ankle, and the ankle over the sole [m], mean of both legs, to 0.1 mm."""
        joint_pos = np.zeros((1, len(self.joint_names)))
        link_pos, link_quat = forward(self.tree, np.zeros((1, 3)), rotation.IDENTITY[None], joint_pos)
        index = self.tree.site_link
        site_pos = link_pos[0, index] + rotation.rotate(link_quat[0, index], self.tree.site_pos)
        legs = []
        for side, sole in zip(("left", "right"), self.feet, strict=True):
            parts = (f"{side}_hip", f"{side}_knee", f"{side}_ankle")
            hip, knee, ankle = (site_pos[self.site(self.human[part])] for part in parts)
            height = ankle[2] - site_pos[self.site(sole), 2]
            legs.append(np.linalg.norm(hip - knee) + np.linalg.norm(knee - ankle) + height)
        return round(float(np.mean(legs)), 4)

    def own_names(self, names: Sequence[str]) -> tuple[str, ...]:
        """Replace joint names of another naming by the robot's own; unknown names are unchanged."""
        own: dict[str, str] = {}
        for naming in self.namings.values():
            own |= dict(zip(naming, self.joint_names, strict=True))
        return tuple(name if name in self.joint_names else own.get(name, name) for name in names)

    def in_naming(self, naming: str) -> "Robot":
        """The robot with joint names of another naming, for exports; its own names are then the naming `own`. Raises
        UnknownNameError."""
        if naming not in self.namings:
            raise UnknownNameError("naming", naming, tuple(self.namings))
        renamed = dict(zip(self.joint_names, self.namings[naming], strict=True))
        return dataclasses.replace(
            self,
            joint_names=self.namings[naming],
            controlled=tuple(renamed[name] for name in self.controlled),
            namings={**self.namings, "own": self.joint_names},
        )

    def clip(
        self,
        name: str,
        fps: float,
        root_pos_w: Float[np.ndarray, "t 3"],
        root_quat_w: Float[np.ndarray, "t 4"],
        joint_pos: Float[np.ndarray, "t j"],
        **more: Any,
    ) -> RobotClip:
        """A motion of the robot; `more` are further fields of the clip."""
        arrays = {"root_pos_w": root_pos_w, "root_quat_w": root_quat_w, "joint_pos": joint_pos, **more}
        return RobotClip(name=name, fps=fps, robot=self.name, joint_names=self.joint_names, **arrays)

    def joint(self, name: str) -> int:
        """Index of a joint. Raises UnknownNameError."""
        return _index("joint", name, self.joint_names)

    def link(self, name: str) -> int:
        """Index of a link. Raises UnknownNameError."""
        return _index("link", name, self.link_names)

    def site(self, name: str) -> int:
        """Index of a site. Raises UnknownNameError."""
        return _index("site", name, self.site_names)


def _index(kind: str, name: str, names: tuple[str, ...]) -> int:
    if name not in names:
        raise UnknownNameError(kind, name, names)
    return names.index(name)
