"""The mean of what is about each frame, for what one frame alone is too rough to tell."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from pipeline import time_series


def windowed_mean(values: Float[np.ndarray, "t ..."], width: int) -> Float[np.ndarray, "t ..."]:
    """Mean over `width` frames (odd) about each frame. Windows don't shrink at the ends of the clip but lie inside it,
    as the differences are roughest there; a clip that is shorter than a window is one window."""
    if len(values) <= width:
        return np.broadcast_to(values.mean(axis=0), values.shape).copy()
    half = width // 2
    centre = np.clip(np.arange(len(values)), half, len(values) - 1 - half)
    return time_series.moving_mean(values, width)[centre]


def odd_width(seconds: float, fps: float) -> int:
    """Frames of a window about a frame that reaches half of `seconds` to either side, and no further."""
    return 2 * int(seconds * fps / 2.0 + 1e-9) + 1
