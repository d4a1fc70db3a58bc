"""Limit the trunk's lean: a robot without a spine leans with its pelvis, so it can follow a bent back only in part.

A runner's chest leans by 45 to 70 degrees while the pelvis leans by half of that. The robot's trunk carries the hips,
so with the chest's lean it would fall. Up to `free_lean` the trunk leans as the chest does; beyond it the lean
saturates at `highest_lean`, unless the person's pelvis leans further (lying, falling).
"""

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.retarget.settings import TrunkSettings

UP = np.array([0.0, 0.0, 1.0])


def limited_lean(
    chest_quat_w: Float[np.ndarray, "t 4"], pelvis_quat_w: Float[np.ndarray, "t 4"], settings: TrunkSettings
) -> tuple[Float[np.ndarray, "t 4"], float]:
    """Orientation of the trunk: the chest's with its lean limited; and the largest reduction [rad].

    The lean is reduced about its own horizontal axis, so its direction is kept.
    """
    lean, allowed = _lean(chest_quat_w), settings.highest_lean - settings.free_lean
    beyond = np.maximum(lean - settings.free_lean, 0.0)
    planned = np.maximum(np.where(beyond > 0.0, settings.free_lean + allowed * np.tanh(beyond / allowed), lean), 0.0)
    excess = np.maximum(lean - np.maximum(planned, _lean(pelvis_quat_w)), 0.0)
    if not excess.any():
        return chest_quat_w, 0.0
    axis_w = rotation.normalize(rotation.cross(np.broadcast_to(UP, (len(lean), 3)), rotation.rotate(chest_quat_w, UP)))
    back = rotation.from_rotvec(-excess[:, None] * axis_w)
    limited = np.where(excess[:, None] > 0.0, rotation.multiply(back, chest_quat_w), chest_quat_w)
    return rotation.make_continuous(limited), float(excess.max())


def _lean(quat_w: Float[np.ndarray, "t 4"]) -> Float[np.ndarray, " t"]:
    """Angle between a body's z axis and the vertical [rad]."""
    return np.arccos(np.clip(rotation.rotate(quat_w, UP)[:, 2], -1.0, 1.0))
