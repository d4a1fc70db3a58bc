"""Numbers of a model file as a table states them."""

import warnings
from collections.abc import Iterable

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from pipeline import rotation

DIGITS = 10
"""Significant digits; more are rounding of a file's own."""
ZERO = 1e-10
RIGHT_ANGLE = 1e-4
"""An angle this close to a multiple of a right angle is meant as one [rad]."""


def rounded(values: Iterable[float]) -> tuple[float, ...]:
    """To `DIGITS` significant digits, without rounding noise about zero."""
    return tuple(0.0 if abs(value) < ZERO else float(f"{value:.{DIGITS}g}") for value in values)


def columns(names: str, values: Iterable[float]) -> dict[str, float]:
    """Values by the columns that they are written to, whose names are separated by blanks."""
    return dict(zip(names.split(), values, strict=True))


def quat_of(matrix: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, " 4"]:
    """Orientation (wxyz, w not negative) of a rotation matrix."""
    return np.roll(Rotation.from_matrix(matrix).as_quat(canonical=True), 1)


def round_axis(quat: Float[np.ndarray, " 4"]) -> Float[np.ndarray, " 4"]:
    """The smallest turn (wxyz) to the long axis of a cylinder or capsule, whose ends and angle about it are alike."""
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
        warnings.simplefilter("ignore", UserWarning)  # gimbal lock: any of the equal triples will do
        angles = Rotation.from_quat(np.roll(quat, -1)).as_euler("xyz")
    steps = np.round(angles / (np.pi / 2))
    near = np.abs(angles - steps * np.pi / 2) < RIGHT_ANGLE
    exact = [step * (np.pi / 2) if right else angle for angle, step, right in zip(angles, steps, near, strict=True)]
    return tuple(float(value) + 0.0 if right else rounded([value])[0] for value, right in zip(exact, near, strict=True))
