"""The polynomial of degree five that joins two motions without a step in position, velocity or acceleration."""

from __future__ import annotations

import numpy as np


def hermite(s: np.ndarray, duration_s: float, start: list[np.ndarray], stop: list[np.ndarray]) -> np.ndarray:
    """Polynomial of degree five (n, k) on s in [0, 1] from value, velocity and acceleration (k,) at both ends."""
    scale = np.array([1.0, duration_s, duration_s**2])
    ends = [part * factor for part, factor in zip((*start, *stop), (*scale, *scale), strict=True)]
    weights = np.stack(
        [
            1 - 10 * s**3 + 15 * s**4 - 6 * s**5,
            s - 6 * s**3 + 8 * s**4 - 3 * s**5,
            0.5 * s**2 - 1.5 * s**3 + 1.5 * s**4 - 0.5 * s**5,
            10 * s**3 - 15 * s**4 + 6 * s**5,
            -4 * s**3 + 7 * s**4 - 3 * s**5,
            0.5 * s**3 - s**4 + 0.5 * s**5,
        ],
        axis=-1,
    )
    return weights @ np.stack(ends)
