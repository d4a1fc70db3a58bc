"""Limb bones brought to given lengths without moving the joints at both ends of a limb."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.repair.tree import CHILDREN, LIMBS, Positions


def keep_lengths(pos_w: Positions, lengths: Float[np.ndarray, "t 19"]) -> Positions:
    """Positions whose limb bones have `lengths` [m] (per frame and body; the bone to the body's parent).

    Knees and elbows move in their limb's plane; an ankle or wrist moves only where the limb is too
    short to reach it; the ball of the foot follows its ankle.
    """
    result = pos_w.copy()
    for upper, middle, lower in LIMBS:
        joint, end = _two_bones(
            result[:, upper], result[:, middle], result[:, lower], lengths[:, middle], lengths[:, lower]
        )
        for toe in CHILDREN[lower]:
            result[:, toe] = end + lengths[:, toe, None] * rotation.normalize(result[:, toe] - result[:, lower])
        result[:, middle], result[:, lower] = joint, end
    return result


def _two_bones(
    upper_w: np.ndarray, middle_w: np.ndarray, lower_w: np.ndarray, first: np.ndarray, second: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Middle and lower joint (t, 3) of a limb with bones `first` and `second` (t,), bent the way `middle_w` is."""
    reach = lower_w - upper_w
    distance = np.linalg.norm(reach, axis=-1)
    allowed = np.clip(distance, np.abs(first - second), first + second)
    along = rotation.normalize(reach)
    out = middle_w - upper_w
    out = rotation.normalize(out - along * np.sum(out * along, axis=-1, keepdims=True))
    share = (first**2 - second**2 + allowed**2) / (2.0 * np.where(allowed > 0.0, allowed, 1.0))
    height = np.sqrt(np.maximum(first**2 - share**2, 0.0))
    return upper_w + along * share[:, None] + out * height[:, None], upper_w + along * allowed[:, None]
