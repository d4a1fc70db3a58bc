"""The skeleton: segment lengths, joints, rest pose. Axes here: x forward, y left, z up [m].

Lengths are fractions of stature after Drillis and Contini (1966) as printed in D. A. Winter,
Biomechanics and Motor Control of Human Movement, 4th ed. (2009), fig. 4.1; the hip joint centres lie
closer together than the body is wide (Seidel et al., J. Biomech. 28, 1995: .24 m wide pelvis, 17 to
18 cm between the centres). The rest pose is a T: identity rotations, arms straight out to the sides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

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


@dataclass(frozen=True, kw_only=True)
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
    low, name = side.lower(), side
    down_foot = (BALL_AHEAD, 0.0, BALL_HEIGHT - ANKLE_HEIGHT)
    return [
        Joint(
            name=f"{name}UpLeg",
            parent="Hips",
            offset=(0.0, sign * HIP_HALF_WIDTH, -PELVIS_ABOVE_HIPS),
            body=f"{low}_hip",
        ),
        Joint(name=f"{name}Leg", parent=f"{name}UpLeg", offset=(0.0, 0.0, -THIGH), body=f"{low}_knee"),
        Joint(name=f"{name}Foot", parent=f"{name}Leg", offset=(0.0, 0.0, -SHANK), body=f"{low}_ankle"),
        Joint(
            name=f"{name}Toe",
            parent=f"{name}Foot",
            offset=down_foot,
            body=f"{low}_toe",
            end=(TOE_LENGTH, 0.0, -0.5 * BALL_HEIGHT),
        ),
    ]


def _arm(side: str, sign: float) -> list[Joint]:
    low, name = side.lower(), side
    return [
        Joint(name=f"{name}Shoulder", parent="Chest", offset=(0.0, sign * 0.03, 0.150), body=None),
        Joint(name=f"{name}Arm", parent=f"{name}Shoulder", offset=(-0.01, sign * 0.15, -0.015), body=f"{low}_shoulder"),
        Joint(name=f"{name}ForeArm", parent=f"{name}Arm", offset=(0.0, sign * UPPER_ARM, 0.0), body=f"{low}_elbow"),
        Joint(
            name=f"{name}Hand",
            parent=f"{name}ForeArm",
            offset=(0.0, sign * FOREARM, 0.0),
            body=f"{low}_wrist",
            end=(0.0, sign * HAND, 0.0),
        ),
    ]


JOINTS: tuple[Joint, ...] = (
    Joint(name="Hips", parent=None, offset=(0.0, 0.0, 0.0), body="pelvis"),
    Joint(name="Spine", parent="Hips", offset=(-0.01, 0.0, 0.10), body="spine"),
    Joint(name="Chest", parent="Spine", offset=(0.0, 0.0, 0.20), body="chest"),
    Joint(name="Neck", parent="Chest", offset=(0.0, 0.0, 0.22), body="neck"),
    Joint(name="Head", parent="Neck", offset=(0.015, 0.0, 0.08), body="head", end=(0.0, 0.0, 0.16)),
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
