"""A motion of the generator's skeleton: root position and world orientation of each joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.generator import skeleton


def solve_leg(
    hip_w: Float[np.ndarray, "n 3"], ankle_w: Float[np.ndarray, "n 3"], yaw: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, "n 4"], Float[np.ndarray, "n 4"]]:
    """World orientations wxyz of thigh and shank; the knee's axis is the foot's left made square to the leg.

    The knee follows from the law of cosines, always bent forward. Raises ValueError for an ankle out of reach.
    """
    line = ankle_w - hip_w
    length = np.linalg.norm(line, axis=-1, keepdims=True)
    thigh, shank = skeleton.THIGH, skeleton.SHANK
    if length.max() >= thigh + shank or length.min() <= abs(thigh - shank):
        raise ValueError(f"an ankle is {length.max():.3f} m from its hip, the leg reaches {thigh + shank:.3f} m.")
    down = line / length
    left = np.stack([-np.sin(yaw), np.cos(yaw), np.zeros_like(yaw)], axis=-1)
    left = rotation.normalize(left - np.sum(left * down, axis=-1, keepdims=True) * down)
    ahead = np.cross(down, left)
    cosine = (thigh**2 + length**2 - shank**2) / (2.0 * thigh * length)
    knee_w = hip_w + thigh * (cosine * down + np.sqrt(1.0 - cosine**2) * ahead)
    return _frame(hip_w - knee_w, left), _frame(knee_w - ankle_w, left)


def _frame(up: np.ndarray, left: np.ndarray) -> Float[np.ndarray, "n 4"]:
    """Orientations wxyz whose z axis is `up` and whose y axis is `left` (square to it)."""
    up = rotation.normalize(up)
    return rotation.make_continuous(rotation.from_matrix(np.stack([np.cross(left, up), left, up], axis=-1)))


def foot_orientation(yaw: np.ndarray, pitch: np.ndarray) -> Float[np.ndarray, "n 4"]:
    """World orientation wxyz of a foot with a yaw and a pitch (heel up positive) [rad]."""
    return rotation.multiply(rotation.about_z(yaw), rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), pitch))


@dataclass(frozen=True, kw_only=True)
class Motion:
    """World: x forward, y left, z up; T frames."""

    fps: float
    """[Hz]"""
    root_pos_w: Float[np.ndarray, "t 3"]
    """Joint `Hips` [m]."""
    quat_w: Mapping[str, Float[np.ndarray, "t 4"]]
    """Orientation of every joint, wxyz; identity in the rest pose."""

    def positions_w(self) -> dict[str, Float[np.ndarray, "t 3"]]:
        """Position of every joint [m]."""
        positions: dict[str, np.ndarray] = {}
        for joint in skeleton.JOINTS:
            if joint.parent is None:
                positions[joint.name] = self.root_pos_w
            else:
                arm = rotation.rotate(self.quat_w[joint.parent], np.array(joint.offset))
                positions[joint.name] = positions[joint.parent] + arm
        return positions

    def local_quat(self, joint: skeleton.Joint) -> Float[np.ndarray, "t 4"]:
        """Orientation of a joint against its parent, wxyz."""
        if joint.parent is None:
            return self.quat_w[joint.name]
        return rotation.multiply(rotation.conjugate(self.quat_w[joint.parent]), self.quat_w[joint.name])
