"""The mirror image of a robot in its x-z plane: partner and sign of each joint."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

AXIS_TOLERANCE = 0.01
"""Largest distance between a mirrored joint axis and its partner's axis: .6 degrees."""


def mirrored_name(name: str, pairs: Sequence[tuple[str, str]]) -> str:
    """`name` with each part of `pairs` replaced by its partner."""
    swap = {piece: other for left, right in pairs for piece, other in ((left, right), (right, left))}
    if not swap:
        return name
    pattern = "|".join(re.escape(piece) for piece in sorted(swap, key=len, reverse=True))
    return re.sub(pattern, lambda match: swap[match.group()], name)


def mirror_index(names: Sequence[str], pairs: Sequence[tuple[str, str]]) -> Int[np.ndarray, " n"]:
    """Index of each name's mirror partner; a name on the mid plane is its own."""
    return np.array([names.index(mirrored_name(name, pairs)) for name in names])


def mirror_sign(axis_root: Float[np.ndarray, "n 3"], index: Int[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Sign with which a joint takes its partner's position: +1 or -1, or 0 if the axes are not mirror images.

    An axis of rotation is a pseudovector: reflection in the x-z plane takes (x, y, z) to (-x, y, -z).

    Args:
        axis_root: joint axes in the root frame, all joints at zero
        index: each joint's partner
    """
    image = axis_root[index] * np.array([-1.0, 1.0, -1.0])
    same = np.linalg.norm(axis_root - image, axis=-1) < AXIS_TOLERANCE
    opposite = np.linalg.norm(axis_root + image, axis=-1) < AXIS_TOLERANCE
    return np.where(same, 1.0, np.where(opposite, -1.0, 0.0))
