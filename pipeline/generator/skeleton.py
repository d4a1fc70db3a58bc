"""The skeleton and its motion: segment lengths, joints, rest pose. Axes here: x forward, y left, z up [m].

Lengths are fractions of stature after Drillis and Contini (1966) as printed in D. A. Winter,
Biomechanics and Motor Control of Human Movement, 4th ed. (2009), fig. 4.1; the hip joint centres are
closer together than the body is wide (Seidel et al., J. Biomech. 28, 1995: 0.24 m wide pelvis, 17 to
18 cm between the centres). The rest pose is a T: identity rotations, arms straight out to the sides.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation

STATURE = 1.75
"""Height of the person [m]."""
THIGH = 0.245 * STATURE
"""Hip to knee [m]."""
SHANK = 0.246 * STATURE
"""Knee to ankle [m]."""
UPPER_ARM = 0.186 * STATURE
FOREARM = 0.146 * STATURE
HAND = 0.108 * STATURE
HIP_HALF_WIDTH = 0.0875
"""Hip joint centre from the mid-plane [m]."""
ANKLE_HEIGHT = 0.039 * STATURE + 0.015
"""Ankle joint above the floor [m]: Winter's barefoot figure and 15 mm of shoe sole."""
FOOT_LENGTH = 0.152 * STATURE
HEEL_BACK = 0.055
"""Rear end of the sole behind the ankle joint [m]."""
BALL_AHEAD = 0.70 * FOOT_LENGTH - HEEL_BACK
"""Ball of the foot (toe joint) ahead of the ankle [m]; the ball lies at 70 % of the foot's length."""
BALL_HEIGHT = 0.025
"""Toe joint above the floor [m]."""
TOE_LENGTH = FOOT_LENGTH - HEEL_BACK - BALL_AHEAD
PELVIS_ABOVE_HIPS = 0.05
"""Origin of the pelvis above the line of the hip joints [m]."""


@dataclass(frozen=True)
class Joint:
    """One joint of the BVH."""

    name: str
    parent: str | None
    offset: tuple[float, float, float]
    """Offset from the parent joint in the rest pose [m]."""
    body: str | None
    """Canonical body that rotates with it; None for the collar bones."""
    end: tuple[float, float, float] | None = None
    """End site of a joint without children."""


def _leg(side: str, sign: float) -> list[Joint]:
    low, ball = side.lower(), (BALL_AHEAD, 0.0, BALL_HEIGHT - ANKLE_HEIGHT)
    return [
        Joint(f"{side}UpLeg", "Hips", (0.0, sign * HIP_HALF_WIDTH, -PELVIS_ABOVE_HIPS), f"{low}_hip"),
        Joint(f"{side}Leg", f"{side}UpLeg", (0.0, 0.0, -THIGH), f"{low}_knee"),
        Joint(f"{side}Foot", f"{side}Leg", (0.0, 0.0, -SHANK), f"{low}_ankle"),
        Joint(f"{side}Toe", f"{side}Foot", ball, f"{low}_toe", end=(TOE_LENGTH, 0.0, -0.5 * BALL_HEIGHT)),
    ]


def _arm(side: str, sign: float) -> list[Joint]:
    low, hand = side.lower(), (0.0, sign * HAND, 0.0)
    return [
        Joint(f"{side}Shoulder", "Chest", (0.0, sign * 0.03, 0.150), None),
        Joint(f"{side}Arm", f"{side}Shoulder", (-0.01, sign * 0.15, -0.015), f"{low}_shoulder"),
        Joint(f"{side}ForeArm", f"{side}Arm", (0.0, sign * UPPER_ARM, 0.0), f"{low}_elbow"),
        Joint(f"{side}Hand", f"{side}ForeArm", (0.0, sign * FOREARM, 0.0), f"{low}_wrist", end=hand),
    ]


JOINTS: tuple[Joint, ...] = (
    Joint("Hips", None, (0.0, 0.0, 0.0), "pelvis"),
    Joint("Spine", "Hips", (-0.01, 0.0, 0.10), "spine"),
    Joint("Chest", "Spine", (0.0, 0.0, 0.20), "chest"),
    Joint("Neck", "Chest", (0.0, 0.0, 0.22), "neck"),
    Joint("Head", "Neck", (0.015, 0.0, 0.08), "head", end=(0.0, 0.0, 0.16)),
    *_arm("Left", 1.0),
    *_arm("Right", -1.0),
    *_leg("Left", 1.0),
    *_leg("Right", -1.0),
)
"""In the order of the BVH, parents first."""

JOINT_OF_BODY: dict[str, str] = {joint.body: joint.name for joint in JOINTS if joint.body is not None}


def offset(name: str) -> Float[np.ndarray, " 3"]:
    """Rest offset of a joint from its parent [m]."""
    return np.array(next(joint.offset for joint in JOINTS if joint.name == name))


def solve_leg(
    hip_w: Float[np.ndarray, "n 3"], ankle_w: Float[np.ndarray, "n 3"], yaw: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, "n 4"], Float[np.ndarray, "n 4"]]:
    """World orientations wxyz of thigh and shank; the knee's axis is the foot's left made square to the leg.

    The knee follows from the law of cosines, always bent forward. Raises ValueError for an ankle out of reach.
    """
    line = ankle_w - hip_w
    length = np.linalg.norm(line, axis=-1, keepdims=True)
    if length.max() >= THIGH + SHANK or length.min() <= abs(THIGH - SHANK):
        raise ValueError(f"an ankle is {length.max():.3f} m from its hip, the leg reaches {THIGH + SHANK:.3f} m.")
    down = line / length
    left = np.stack([-np.sin(yaw), np.cos(yaw), np.zeros_like(yaw)], axis=-1)
    left = rotation.normalize(left - np.sum(left * down, axis=-1, keepdims=True) * down)
    ahead = np.cross(down, left)
    cosine = (THIGH**2 + length**2 - SHANK**2) / (2.0 * THIGH * length)
    knee_w = hip_w + THIGH * (cosine * down + np.sqrt(1.0 - cosine**2) * ahead)
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
        for joint in JOINTS:
            if joint.parent is None:
                positions[joint.name] = self.root_pos_w
            else:
                arm = rotation.rotate(self.quat_w[joint.parent], np.array(joint.offset))
                positions[joint.name] = positions[joint.parent] + arm
        return positions

    def local_quat(self, joint: Joint) -> Float[np.ndarray, "t 4"]:
        """Orientation of a joint against its parent, wxyz."""
        if joint.parent is None:
            return self.quat_w[joint.name]
        return rotation.multiply(rotation.conjugate(self.quat_w[joint.parent]), self.quat_w[joint.name])
