"""Rotation maths on quaternions wxyz, vectorised over leading axes. The only place for it.

Conventions: `quat` is wxyz and unit; `R_world_body` maps body coordinates to world coordinates;
angles in rad. scipy's `Rotation` does what is general (conversion, mean); what is here is what a
clip needs frame by frame: products, sign continuity, twist, interpolation, angular velocity.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

Quats = Float[np.ndarray, "... 4"]
Vectors = Float[np.ndarray, "... 3"]
Matrices = Float[np.ndarray, "... 3 3"]
if TYPE_CHECKING:
    Angles = np.ndarray
else:  # one angle is a numpy scalar, as from numpy's own functions, whose stubs promise an array as well
    Angles = Float[np.ndarray | np.floating, "..."]

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def normalize(vectors: Float[np.ndarray, "*n d"]) -> Float[np.ndarray, "*n d"]:
    """Unit vectors along the last axis. A zero vector stays zero."""
    squares = vectors * vectors
    total = squares[..., 0]
    for part in range(1, squares.shape[-1]):
        total = total + squares[..., part]
    length = np.sqrt(total)[..., None]
    return vectors / np.where(length > 0.0, length, 1.0)


def multiply(a: Quats, b: Quats) -> Quats:
    """Hamilton product a b of quaternions (..., 4), broadcasting; R(ab) = R(a) R(b)."""
    aw, ax, ay, az = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bw, bx, by, bz = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    w = aw * bw - ax * bx - ay * by - az * bz
    product = np.empty((*np.shape(w), 4))
    product[..., 0] = w
    product[..., 1] = aw * bx + ax * bw + ay * bz - az * by
    product[..., 2] = aw * by - ax * bz + ay * bw + az * bx
    product[..., 3] = aw * bz + ax * by - ay * bx + az * bw
    return product


def conjugate(quat: Quats) -> Quats:
    """Inverse of unit quaternions (..., 4)."""
    return quat * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(quat: Quats, vector: Vectors) -> Vectors:
    """Rotate vectors (..., 3) by quaternions (..., 4), broadcasting over leading axes."""
    w, x, y, z = quat[..., 0], quat[..., 1], quat[..., 2], quat[..., 3]
    vx, vy, vz = vector[..., 0], vector[..., 1], vector[..., 2]
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    rotated = np.empty((*np.shape(tx), 3))
    rotated[..., 0] = vx + w * tx + (y * tz - z * ty)
    rotated[..., 1] = vy + w * ty + (z * tx - x * tz)
    rotated[..., 2] = vz + w * tz + (x * ty - y * tx)
    return rotated


_AFTER, _LATER = [1, 2, 0], [2, 0, 1]
"""The two axes that a cross product multiplies for each axis."""
_FACTOR = [[0, 1, 2, 3], [5, 0, 7, 2], [6, 3, 0, 5], [7, 6, 1, 0]]
"""At [i][k]: which of the 8 numbers (b, -b) multiplies component i of a in component k of the product."""


def factors(b: Float[np.ndarray, "4 ..."]) -> Float[np.ndarray, "4 4 ..."]:
    """Quaternions (4, ...) as right factors of `product`."""
    return np.concatenate([b, -b])[_FACTOR]


def product(a: Float[np.ndarray, "4 ..."], b: Float[np.ndarray, "4 4 ..."]) -> Float[np.ndarray, "4 ..."]:
    """`multiply(a, b)`, bit for bit, of quaternions with the component as first axis; b as `factors`. It is faster for
    short arrays."""
    of_w, of_x, of_y, of_z = a[:, None] * b
    return of_w + of_x + of_y + of_z


def rotate_parts(quat: Float[np.ndarray, "4 ..."], vector: Float[np.ndarray, "3 ..."]) -> Float[np.ndarray, "3 ..."]:
    """`rotate(quat, vector)`, bit for bit, with the component as first axis."""
    after, later = quat[[2, 3, 1]], quat[[3, 1, 2]]
    twice = 2.0 * (after * vector[_LATER] - later * vector[_AFTER])
    return vector + quat[0] * twice + (after * twice[_LATER] - later * twice[_AFTER])


def cross(a: Vectors, b: Vectors) -> Vectors:
    """Cross product of vectors (..., 3), broadcasting; the bits of `np.cross` in half its time."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def length(vectors: Vectors) -> Angles:
    """Length of vectors (..., 3); the bits of `np.linalg.norm` in a third of its time."""
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.sqrt(x * x + y * y + z * z)


def rotate_inverse(quat: Quats, vector: Vectors) -> Vectors:
    """Rotate vectors (..., 3) by the inverse of quaternions (..., 4): world to body."""
    return rotate(conjugate(quat), vector)


def make_continuous(quat: Float[np.ndarray, "t *n 4"]) -> Float[np.ndarray, "t *n 4"]:
    """The same rotations with signs chosen so that neighbours in time have a positive dot product."""
    products = quat[1:] * quat[:-1]
    turned = products[..., 0] + products[..., 1] + products[..., 2] + products[..., 3] < 0.0
    if not turned.any():
        return quat.copy()
    signs = np.cumprod(np.where(turned, -1.0, 1.0), axis=0)[..., None]
    return np.concatenate([quat[:1], quat[1:] * signs])


def from_matrix(matrix: Matrices) -> Quats:
    """Quaternions wxyz (..., 4) of rotation matrices (..., 3, 3)."""
    flat = Rotation.from_matrix(matrix.reshape(-1, 3, 3)).as_quat()
    return np.roll(flat, 1, axis=-1).reshape(*matrix.shape[:-2], 4)


def to_matrix(quat: Quats) -> Matrices:
    """Rotation matrices (..., 3, 3) of quaternions wxyz (..., 4)."""
    w, x, y, z = np.moveaxis(quat, -1, 0)
    entries = [
        *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    ]
    return np.stack(entries, axis=-1).reshape(*quat.shape[:-1], 3, 3)


def from_rotvec(rotvec: Vectors) -> Quats:
    """Quaternions wxyz (..., 4) of rotation vectors (..., 3) [rad]."""
    angle = np.linalg.norm(rotvec, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), rotvec * np.sinc(angle / (2 * np.pi)) / 2], axis=-1)


def to_rotvec(quat: Quats) -> Vectors:
    """Rotation vectors (..., 3) [rad] of quaternions wxyz (..., 4), the shorter way round."""
    quat = quat * np.where(quat[..., :1] < 0.0, -1.0, 1.0)
    sine = length(quat[..., 1:])
    angle = 2.0 * np.arctan2(sine, quat[..., 0])
    scale = np.where(sine > 1e-12, angle / np.where(sine > 1e-12, sine, 1.0), 2.0)
    return quat[..., 1:] * scale[..., None]


def from_axis_angle(axis: Vectors, angle: Angles | float) -> Quats:
    """Quaternions wxyz (..., 4) of a rotation by `angle` [rad] (...) about a unit `axis` (3,)."""
    half = np.asarray(angle)[..., None] / 2.0
    return np.concatenate([np.cos(half), np.sin(half) * np.asarray(axis)], axis=-1)


def from_euler(turns: Sequence[tuple[int, Float[np.ndarray, "*n"]]]) -> Float[np.ndarray, "*n 4"]:
    """Quaternions wxyz of turns one after another, each about an axis (0, 1, 2) of the frame turned so far [rad].

    The bits of `multiply` and `from_axis_angle`, whose products with zeros are left out.
    """
    parts = [np.ones_like(turns[0][1]), *(np.zeros_like(turns[0][1]) for _ in range(3))]
    for axis, angle in turns:
        cos, sin = np.cos(angle / 2.0), np.sin(angle / 2.0)
        # of quaternions q, (0, unit vector along the axis): products of w and the axis' own part, and of the others
        w, own, after, later = (parts[index] for index in (0, 1 + axis, 1 + (axis + 1) % 3, 1 + (axis + 2) % 3))
        parts[0], parts[1 + axis] = w * cos - own * sin, w * sin + own * cos
        parts[1 + (axis + 1) % 3], parts[1 + (axis + 2) % 3] = after * cos + later * sin, later * cos - after * sin
    return np.stack(parts, axis=-1)


def about_z(yaw: Angles | float) -> Quats:
    """Quaternions wxyz (..., 4) of rotations by `yaw` [rad] (...) about z."""
    return from_axis_angle(np.array([0.0, 0.0, 1.0]), yaw)


def yaw_of(quat: Quats) -> Angles:
    """Twist about world z [rad] (...), in (-pi, pi], of quaternions wxyz (..., 4) (swing-twist)."""
    return wrap(2.0 * np.arctan2(quat[..., 3], quat[..., 0]))


def wrap(angle: Angles | float) -> Angles:
    """The same angle [rad] in (-pi, pi]."""
    return -(np.mod(-np.asarray(angle) + np.pi, 2.0 * np.pi) - np.pi)


def angle_between(a: Quats, b: Quats) -> Angles:
    """Angle [rad] (...) of the rotation from quaternions `a` to `b` (..., 4); knows that q = -q."""
    return np.linalg.norm(to_rotvec(multiply(conjugate(a), b)), axis=-1)


def slerp(a: Quats, b: Quats, fraction: Angles | float) -> Quats:
    """Spherical interpolation from `a` to `b` (..., 4) at `fraction` (...), the shorter way."""
    step = to_rotvec(multiply(conjugate(a), b))
    return multiply(a, from_rotvec(step * np.asarray(fraction)[..., None]))


def angular_velocity_w(quat: Float[np.ndarray, "t *n 4"], fps: float) -> Float[np.ndarray, "t *n 3"]:
    """World-frame angular velocity [rad/s] by central differences, one-sided at both ends.

    At frame i it is the rotation vector from frame i-1 to i+1 over 2/fps. One frame gives zero.
    """
    if len(quat) < 2:
        return np.zeros((*quat.shape[:-1], 3))
    index = np.arange(len(quat))
    after, before = np.minimum(index + 1, len(quat) - 1), np.maximum(index - 1, 0)
    step = to_rotvec(multiply(quat[after], conjugate(quat[before])))
    return step * (fps / (after - before)).reshape(-1, *([1] * (quat.ndim - 1)))
