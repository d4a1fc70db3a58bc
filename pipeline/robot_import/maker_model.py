"""A manufacturer's model as read from its file: links, joints, shapes, sites.

Links without a movable joint are merged into their parents by the readers, so every link but the root has one hinge.
"""

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from pipeline import rotation


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
    """A link, including the mass of all parts fixed to it."""

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
    """Name of the shape; empty if the file has none."""
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
    """A model file. `links[0]` is the root; links are in depth-first order."""

    path: Path
    links: tuple[MakerLink, ...]
    shapes: tuple[MakerShape, ...]
    sites: tuple[MakerSite, ...]
    notes: tuple[str, ...]
    """Parts of the file that were not used, one sentence each."""

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
    """Points that span a shape, in the link frame [m]: vertices, corners of boxes, and of round shapes the extremes of
    each end along the axes of the link."""
    if shape.points is not None:
        return shape.points
    if shape.kind == "box":
        local = np.array(np.meshgrid(*([-half, half] for half in shape.size))).reshape(3, -1).T
        return shape.pos + rotation.rotate(shape.quat, local)
    axis = rotation.rotate(rotation.normalize(shape.quat), np.array([0.0, 0.0, 1.0]))
    radius, *length = shape.size
    half = length[0] if length else 0.0
    around = np.eye(3)
    if shape.kind == "cylinder":  # points on the rims, perpendicular to the axis
        around -= np.outer(axis, axis)
        around /= np.maximum(np.linalg.norm(around, axis=1, keepdims=True), ZERO)
    ends = (shape.pos - half * axis, shape.pos + half * axis)
    return np.vstack([end + side * radius * around for end in ends for side in (1.0, -1.0)])


DIGITS = 10
"""Significant digits; further ones are rounding errors of the file."""
ZERO = 1e-10
RIGHT_ANGLE = 1e-4
"""Deviation up to which an angle is rounded to a multiple of 90 degrees [rad]."""


def rounded(values: Iterable[float]) -> tuple[float, ...]:
    """To `DIGITS` significant digits, without rounding noise about zero."""
    return tuple(0.0 if abs(value) < ZERO else float(f"{value:.{DIGITS}g}") for value in values)


def columns(names: str, values: Iterable[float]) -> dict[str, float]:
    """Column -> value; `names` are the columns separated by blanks."""
    return dict(zip(names.split(), values, strict=True))


def quat_of(matrix: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, " 4"]:
    """Orientation (wxyz, w not negative) of a rotation matrix."""
    return np.roll(Rotation.from_matrix(matrix).as_quat(canonical=True), 1)


def round_axis(quat: Float[np.ndarray, " 4"]) -> Float[np.ndarray, " 4"]:
    """The smallest rotation (wxyz) to the long axis of a cylinder or capsule, which is symmetric about it."""
    axis = rotation.rotate(quat, np.array([0.0, 0.0, 1.0]))
    x, y, z = np.where(np.abs(axis) < RIGHT_ANGLE, 0.0, axis).tolist()
    if z < 0.0 or (z == 0.0 and (y > 0.0 or (y == 0.0 and x < 0.0))):
        x, y, z = -x, -y, -z
    length = np.hypot(x, y)
    if length == 0.0:
        return rotation.IDENTITY
    return rotation.from_rotvec(np.arctan2(length, z) * np.array([-y, x, 0.0]) / length)


def rpy_of(quat: Float[np.ndarray, " 4"]) -> tuple[float, ...]:
    """Roll, pitch, yaw about fixed axes [rad] of an orientation (wxyz); right angles are exact."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # gimbal lock: any equivalent triple is valid
        angles = Rotation.from_quat(np.roll(quat, -1)).as_euler("xyz")
    steps = np.round(angles / (np.pi / 2))
    near = np.abs(angles - steps * np.pi / 2) < RIGHT_ANGLE
    exact = [step * (np.pi / 2) if right else angle for angle, step, right in zip(angles, steps, near, strict=True)]
    return tuple(float(value) + 0.0 if right else rounded([value])[0] for value, right in zip(exact, near, strict=True))
