"""Move feet outward where the hips cannot adduct far enough, so that the pelvis can keep its path.

A hip with the adduction limit `a` reaches ankles with `outward >= -sin(a) * distance`, where `outward` is the
distance from hip to ankle along the pelvis's outward axis and `distance` the distance from hip to ankle. In side
steps, people bring their feet further inward or cross them. After `narrowing`, the remainder is corrected here: a
whole foothold is moved outward by the shortfall in the worst frame of its stance, a swinging foot in each frame.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation, time_series
from pipeline.retarget.foot_plan import X, Z
from pipeline.retarget.foot_spacing import lateral_axis, push_outward
from pipeline.retarget.robot_body import RobotBody


@dataclass(frozen=True, kw_only=True)
class Hips:
    """The robot's hips along the planned pelvis path, t frames."""

    pos_w: Float[np.ndarray, "t 2 3"]
    """Hip joints (left, right) [m]."""
    left_w: Float[np.ndarray, "t 3"]
    """The pelvis link's axis to the left, unit."""
    sin_adduction: Float[np.ndarray, " 2"]
    """Sine of the largest adduction, (left, right)."""


def hips_of(
    centre_w: Float[np.ndarray, "t 3"],
    trunk_quat_w: Float[np.ndarray, "t 4"],
    waist_pos: Float[np.ndarray, " t"],
    body: RobotBody,
) -> Hips:
    """Hips around their planned midpoint; the pelvis link is the trunk turned by the waist."""
    pelvis_quat_w = rotation.multiply(trunk_quat_w, rotation.about_z(waist_pos))
    left_w = rotation.rotate(pelvis_quat_w, np.array([0.0, 1.0, 0.0]))
    apart = np.array([body.hip_half_width, -body.hip_half_width])
    pos_w = centre_w[:, None] + apart[:, None] * left_w[:, None]
    return Hips(pos_w=pos_w, left_w=left_w, sin_adduction=np.sin(body.hip_adduction))


def lacking(feet: Float[np.ndarray, "2 t 5"], hips: Hips) -> Float[np.ndarray, "2 t"]:
    """Outward shift [m], 0 or more, that each ankle needs to be within the hip's adduction limit."""
    legs_w = feet[..., X : Z + 1] - hips.pos_w.swapaxes(0, 1)
    outward = np.sum(legs_w * hips.left_w, axis=2) * [[1.0], [-1.0]]
    return np.maximum(-hips.sin_adduction[:, None] * rotation.length(legs_w) - outward, 0.0)


def bring_footholds_in_reach(
    locked: Float[np.ndarray, "2 t 5"],
    contacts: Bool[np.ndarray, "t 2"],
    heading: Float[np.ndarray, " t"],
    hips: Hips,
    free: float,
) -> float:
    """Move whole footholds outward, in place, so that no hip exceeds its adduction limit; return the largest shift [m].

    Args:
        free: shortfall [m] that is left uncorrected, since the trunk compensates for it
    """
    lateral_w, largest = lateral_axis(heading), 0.0
    for side, short in enumerate(np.maximum(lacking(locked, hips) - free, 0.0)):
        for start, stop in time_series.runs(contacts[:, side]) if short.any() else ():
            worst = start + int(np.argmax(short[start:stop]))
            locked[side, start:stop, :2] += (1.0 - 2.0 * side) * short[worst] * lateral_w[worst]
            largest = max(largest, float(short[worst]))
    return largest


def bring_swings_in_reach(
    plans: Float[np.ndarray, "2 t 5"],
    contacts: Bool[np.ndarray, "t 2"],
    heading: Float[np.ndarray, " t"],
    hips: Hips,
    free: float,
    spread: float,
) -> None:
    """Move swinging feet outward in place, as `bring_footholds_in_reach` does footholds.

    Args:
        spread: fade-in and fade-out of a shift [frames]
    """
    for side, short in enumerate(np.maximum(lacking(plans, hips) - free, 0.0)):
        push_outward(plans[side], side, ~contacts[:, side], short, heading, spread)
