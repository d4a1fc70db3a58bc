"""How far the trunk leans: a robot without a spine leans with its pelvis, so a bent back is followed part of the way.

A runner's chest leans by 45 to 70 degrees while the pelvis leans by half of that. The robot's trunk carries the hips:
leaning as far as the chest it would be falling. Up to `free_lean` the trunk leans as the chest does, beyond it less and
less, never more than `highest_lean` unless the person's pelvis does (lying, falling).
"""

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.retarget.settings import TrunkSettings

UP = np.array([0.0, 0.0, 1.0])


def limited_lean(
    chest_quat_w: Float[np.ndarray, "t 4"], pelvis_quat_w: Float[np.ndarray, "t 4"], settings: TrunkSettings
) -> tuple[Float[np.ndarray, "t 4"], float]:
    """Orientation of the trunk: the chest's with its lean limited; and the largest angle that was taken off [rad].

    The lean is taken back about the horizontal axis that it is about, so the direction of the lean is kept.
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
