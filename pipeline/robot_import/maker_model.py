"""A maker's model as read from its file, before anything is proposed: links, joints, shapes, sites.

Links without a movable joint are merged into their parents by the readers, so every link but the root has one hinge.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio
from jaxtyping import Float

from pipeline import rotation
from pipeline.robot_import.numbers import quat_of


@dataclass(frozen=True, kw_only=True)
class MakerJoint:
    """A hinge: torque [N m], speed [rad/s], armature [kg m^2], kp [N m/rad], kd [N m s/rad]; None if not stated."""

    name: str
    axis: Float[np.ndarray, " 3"]
    """Unit vector in the joint frame."""
    lower: float | None
    upper: float | None
    """Position limits [rad]."""
    torque: float | None
    speed: float | None
    armature: float | None
    kp: float | None = None
    kd: float | None = None
    """[N m s/rad]"""


@dataclass(frozen=True, kw_only=True)
class MakerLink:
    """A link with the mass of everything that is fixed to it."""

    name: str
    parent: int
    """Index of the parent; -1 for the root."""
    joint: MakerJoint | None
    """The hinge to the parent; None for the root."""
    pos: Float[np.ndarray, " 3"]
    """Joint frame in the parent's frame [m]."""
    quat: Float[np.ndarray, " 4"]
    """Joint frame in the parent's frame, wxyz."""
    mass: float
    """[kg]"""
    com: Float[np.ndarray, " 3"]
    """Centre of mass in the link frame [m]."""
    inertia: Float[np.ndarray, "3 3"]
    """About the centre of mass, axes of the link frame [kg m^2]."""


@dataclass(frozen=True, kw_only=True)
class MakerShape:
    """A shape on a link."""

    name: str
    """Empty where the file gives none."""
    link: str
    kind: str
    """`box`, `sphere`, `cylinder`, `capsule`, or `mesh`."""
    collides: bool
    shown: bool
    pos: Float[np.ndarray, " 3"]
    """In the link frame [m]."""
    quat: Float[np.ndarray, " 4"]
    """In the link frame, wxyz."""
    size: tuple[float, ...] = ()
    """As in shapes.csv: half extents; radius; radius and half length [m]."""
    points: Float[np.ndarray, "n 3"] | None = None
    """Vertices of a mesh in the link frame [m]; None for primitives."""


@dataclass(frozen=True, kw_only=True)
class MakerSite:
    """A named point on a link."""

    name: str
    link: str
    pos: Float[np.ndarray, " 3"]
    """In the link frame [m]."""


@dataclass(frozen=True, kw_only=True)
class MakerModel:
    """A model file. `links[0]` is the root; the order is a walk down one limb after the other."""

    path: Path
    links: tuple[MakerLink, ...]
    shapes: tuple[MakerShape, ...]
    sites: tuple[MakerSite, ...]
    notes: tuple[str, ...]
    """What of the file was not used, a sentence each."""

    @property
    def joints(self) -> tuple[MakerJoint, ...]:
        return tuple(link.joint for link in self.links if link.joint is not None)

    def children(self, index: int) -> list[int]:
        return [child for child, link in enumerate(self.links) if link.parent == index]

    def origins(self) -> tuple[Float[np.ndarray, "l 3"], Float[np.ndarray, "l 4"]]:
        """Poses of the links in the root frame, all joints at zero."""
        pos, quat = [np.zeros(3)], [rotation.IDENTITY]
        for link in self.links[1:]:
            pos.append(pos[link.parent] + rotation.rotate(quat[link.parent], link.pos))
            quat.append(rotation.multiply(quat[link.parent], link.quat))
        return np.array(pos), np.array(quat)


def link_of(
    name: str, parent: int, joint: MakerJoint | None, placement: pinocchio.SE3, inertia: pinocchio.Inertia
) -> MakerLink:
    """A link from Pinocchio's placement of its joint in the parent's frame, and its inertia."""
    return MakerLink(
        name=name,
        parent=parent,
        joint=joint,
        pos=np.array(placement.translation),
        quat=quat_of(np.array(placement.rotation)),
        mass=float(inertia.mass),
        com=np.array(inertia.lever),
        inertia=np.array(inertia.inertia),
    )


def corner_points(shape: MakerShape) -> Float[np.ndarray, "n 3"]:
    """Points that span a shape, in the link frame [m]: vertices, corners of boxes, extremes of round shapes."""
    if shape.points is not None:
        return shape.points
    if shape.kind == "box":
        local = np.array(np.meshgrid(*([-half, half] for half in shape.size))).reshape(3, -1).T
    else:
        radius = shape.size[0]
        half = shape.size[1] if len(shape.size) > 1 else 0.0
        along = half + (radius if shape.kind == "capsule" else 0.0)
        if shape.kind == "sphere":
            along = radius
        local = np.vstack([np.diag([radius, radius, along]), -np.diag([radius, radius, along])])
        if shape.kind == "cylinder":
            ring = np.array([[radius, 0.0], [-radius, 0.0], [0.0, radius], [0.0, -radius]])
            local = np.vstack([np.column_stack([ring, np.full(4, end)]) for end in (-half, half)])
    return shape.pos + rotation.rotate(shape.quat, local)
