"""Checks on quaternions from files: unit, and in the order that is claimed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.errors import FileError

NORM_MIN, NORM_MAX = 0.99, 1.01
"""Norms beyond these are no rounding: the numbers are not unit quaternions."""


def check_unit(path: Path, quat: np.ndarray, what: str, first: int = 0) -> None:
    """Check that quaternions (t, ..., 4) of the frames from `first` on are unit; NaN passes.

    Raises FileError with the first frame that is not.
    """
    norm = np.linalg.norm(quat, axis=-1).reshape(len(quat), -1)
    wrong = np.flatnonzero(((norm < NORM_MIN) | (norm > NORM_MAX)).any(axis=1))
    if len(wrong):
        worst = float(norm[wrong[0]][np.nanargmax(np.abs(norm[wrong[0]] - 1.0))])
        problem = f"{what} at frame {first + wrong[0]} has norm {worst:.3g}, wanted {NORM_MIN} to {NORM_MAX}."
        raise FileError(path, problem, "It is not a unit quaternion: check the columns.")
