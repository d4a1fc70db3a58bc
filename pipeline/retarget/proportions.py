"""Lengths that a person and the robot are compared by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation
from pipeline.clips.human_clip import FEET, HumanClip
from pipeline.errors import ClipError

FLAT_PERCENTILE = 30.0
"""Of the foot's pitch over its stance frames: heel rise makes the upper part, so the foot is flat below."""

FLAT_TOLERANCE = 0.05
"""[rad] A foot pitched this much more than flat still counts as flat."""

PLAUSIBLE_LEG = (0.3, 1.4)
"""Leg lengths [m] of anything that is a person; outside of it the unit is wrong."""


@dataclass(frozen=True, kw_only=True)
class Proportions:
    """What a person's skeleton and stance say, each as one number for the clip."""

    leg: float
    """Hip to knee plus knee to ankle, median, mean of both sides [m]."""
    hip_half_width: float
    """Half the distance of the hip joints [m]."""
    ankle_height: Float[np.ndarray, 2]
    """Height of each ankle while the foot is flat on the ground, (left, right) [m]."""
    flat_pitch: Float[np.ndarray, 2]
    """Angle of the line from toe to ankle over the ground while the foot is flat, (left, right) [rad]."""
    ankle_to_toe: Float[np.ndarray, 2]
    """Horizontal way from ankle to toe while the foot is flat, (left, right) [m]."""


def measure(clip: HumanClip, contacts: Bool[np.ndarray, "t 2"]) -> Proportions:
    """Proportions of the person in a clip. Raises ClipError where no person can have them."""
    legs, ankle_height, flat_pitch, ankle_to_toe = [], [], [], []
    for index, side in enumerate(FEET):
        hip, knee, ankle, toe = (clip.pos(f"{side}_{part}") for part in ("hip", "knee", "ankle", "toe"))
        legs.append(np.median(_distance(hip, knee)) + np.median(_distance(knee, ankle)))
        pitch = foot_pitch(ankle, toe)
        stands = contacts[:, index] if contacts[:, index].any() else toe[:, 2] <= np.percentile(toe[:, 2], 10.0)
        flat = np.percentile(pitch[stands], FLAT_PERCENTILE)
        flat_pitch.append(flat)
        ankle_height.append(np.median(ankle[stands, 2][pitch[stands] <= flat + FLAT_TOLERANCE]))
        ankle_to_toe.append(np.median(_distance(ankle, toe)) * np.cos(flat))
    leg = float(np.mean(legs))
    if not PLAUSIBLE_LEG[0] <= leg <= PLAUSIBLE_LEG[1]:
        low, high = PLAUSIBLE_LEG
        raise ClipError(clip.name, "leg_length", f"the legs are {leg:.3g} m long, a person's are {low} to {high} m.")
    return Proportions(
        leg=leg,
        hip_half_width=float(np.median(_distance(clip.pos("left_hip"), clip.pos("right_hip")))) / 2.0,
        ankle_height=np.array(ankle_height),
        flat_pitch=np.array(flat_pitch),
        ankle_to_toe=np.array(ankle_to_toe),
    )


def foot_pitch(ankle_pos_w: Float[np.ndarray, "t 3"], toe_pos_w: Float[np.ndarray, "t 3"]) -> Float[np.ndarray, " t"]:
    """Angle of the line from toe to ankle over the ground [rad]; it grows as the heel rises, up to pi/2."""
    line = ankle_pos_w - toe_pos_w
    return np.arctan2(line[:, 2], np.linalg.norm(line[:, :2], axis=-1))


def _distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return rotation.length(a - b)
