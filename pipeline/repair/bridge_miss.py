"""How far what is in a short gap is from the cubic through the two frames on either side of it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

REACH = 2
"""A bad frame disturbs the bridges of this many frames on either side."""


def interpolation_miss(values: Float[np.ndarray, "t n d"], gap: int) -> Float[np.ndarray, "t n d"]:
    """Middle of each window of `gap` frames less the cubic through the two frames on either side of it.

    Of an even gap the middle lies half a frame after its frame. Zero where the window has no neighbours.
    """
    inner, outer = (gap + 1) / 2.0, (gap + 3) / 2.0
    near = outer**2 / (outer**2 - inner**2) / 2.0
    width = gap + 2 * REACH
    count = len(values) - width + 1
    result = np.zeros(values.shape)
    if count < 1:
        return result

    def at(offset: int) -> np.ndarray:
        return values[offset : offset + count]

    first = REACH + (gap - 1) // 2
    middle = at(first) if gap % 2 else 0.5 * (at(first) + at(first + 1))
    sides = near * (at(1) + at(width - 2)) + (0.5 - near) * (at(0) + at(width - 1))
    result[first : first + count] = middle - sides
    return result


def size_of(vectors: Float[np.ndarray, "t n d"]) -> Float[np.ndarray, "t n"]:
    """Lengths of vectors of any dimension."""
    return np.sqrt(np.einsum("tnd,tnd->tn", vectors, vectors))
