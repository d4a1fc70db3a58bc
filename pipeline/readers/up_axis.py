"""Which axis of a file points up, and the fixed change of axes to z up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline.errors import AmbiguousFileError, FileError

TO_Z_UP: dict[str, np.ndarray] = {
    "z": np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]),
    "y": np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    "x": np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]),
    "-z": np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]),
    "-y": np.array([[0.0, 0, -1], [1, 0, 0], [0, -1, 0]]),
    "-x": np.array([[0.0, -1, 0], [0, 0, 1], [-1, 0, 0]]),
}
"""Rotation from a file's axes to the world's, by the file's up axis. A y-up file's z becomes x (forward)."""

MIN_COSINE = 0.8
"""How well the mean direction from feet to head has to agree with one axis (37 degrees)."""

MIN_SHARE = 0.5
"""Share of the frames in which the head has to be above the feet along it."""


def find_up_axis(path: Path, feet_to_head: Float[np.ndarray, "t 3"], stated: str | None) -> str:
    """The file's up axis, from the vector of the feet's middle to the head in each frame (NaN where missing).

    Raises AmbiguousFileError when no axis fits, FileError for a stated axis that isn't one.
    """
    if stated is not None:
        if stated not in TO_Z_UP:
            raise FileError(path, f"the stated up axis is '{stated}', wanted one of {', '.join(TO_Z_UP)}.")
        return stated
    valid = feet_to_head[np.isfinite(feet_to_head).all(axis=1)]
    direction = valid / np.maximum(np.linalg.norm(valid, axis=1, keepdims=True), 1e-12)
    mean = direction.mean(axis=0) if len(direction) else np.zeros(3)
    axis = int(np.argmax(mean))
    cosine = mean[axis] / max(float(np.linalg.norm(mean)), 1e-12)
    share = float(np.mean(direction[:, axis] > MIN_COSINE)) if len(direction) else 0.0
    if cosine < MIN_COSINE or share < MIN_SHARE:
        found = ", ".join(f"{value:.2f} along {name}" for name, value in zip("xyz", mean, strict=True))
        problem = (
            f"the up axis can't be inferred: from the feet to the head is on average {found}, and the head is above "
            f"the feet along one axis in {100 * share:.0f} % of the frames."
        )
        raise AmbiguousFileError(path, problem, "State `up:` for it in data/sources.yaml, such as `up: y`.")
    return "xyz"[axis]
