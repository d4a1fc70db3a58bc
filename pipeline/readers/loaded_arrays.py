"""Pickles (`.pkl`) and files of `torch.save` (`.pt`) as named arrays: one motion, in however many dictionaries."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import FileError
from pipeline.files.array_file import ArrayFile
from pipeline.readers.restricted_pickle import PickledArray

MAX_DEPTH = 4
"""Dictionaries in each other that are looked through."""

MAX_LIST = 10_000
"""Entries of a list that is taken for an array."""

GLOBAL = "smpl_params_global"
"""Where GVHMR puts the motion in the world's frame."""

GVHMR_RATE_HZ = 30.0
"""Rate at which GVHMR works; its results name none."""


@dataclass(frozen=True, kw_only=True)
class LoadedArrays(ArrayFile):
    """Arrays that were loaded."""

    path: Path
    shapes: Mapping[str, tuple[int, ...]]
    values: Mapping[str, np.ndarray]
    assumed_fps: float | None = None
    """The rate of the program that writes such files [Hz]."""

    def stored(self, name: str) -> np.ndarray:
        """One array as it was loaded. Raises FileError when it is missing."""
        if name not in self.values:
            raise FileError(self.path, f"'{name}' is missing; there are: {', '.join(sorted(self.values))}.")
        return self.values[name]


def open_loaded(path: Path, load: Callable[[Path], Any]) -> LoadedArrays:
    """The one motion in a file that `load_pickle` or `load_torch` reads. Raises FileError, or OSError of the disk."""
    value, assumed = load(path), None
    for _ in range(MAX_DEPTH):
        if not isinstance(value, dict):
            raise FileError(path, f"it holds a {type(value).__name__}, wanted named arrays of one motion.")
        if isinstance(value.get(GLOBAL), dict):
            value, assumed = value[GLOBAL], GVHMR_RATE_HZ
        arrays = {str(name): array for name, each in value.items() if (array := _array(each)) is not None}
        inner = {str(name): each for name, each in value.items() if isinstance(each, dict)}
        if any(array.ndim >= 2 for array in arrays.values()) or not inner:
            shapes = {name: array.shape for name, array in arrays.items()}
            return LoadedArrays(path=path, shapes=shapes, values=arrays, assumed_fps=assumed)
        if len(inner) > 1:
            names = ", ".join(name[:40] for name in list(inner)[:5])
            do = f"Write a file for each, as {path.stem}_<motion>.npz with numpy.savez(name, **motion)."
            raise FileError(path, f"it holds {len(inner)} motions ({names}, ...); a file holds one.", do)
        (value,) = inner.values()
    raise FileError(path, f"its arrays are in more than {MAX_DEPTH} dictionaries.")


def _array(value: Any) -> np.ndarray | None:
    """A value as an array; None for what is none."""
    if isinstance(value, PickledArray):
        return value.value
    if isinstance(value, np.ndarray):
        return value
    if isinstance(value, (bool, int, float, str)):
        return np.array(value)
    if isinstance(value, (list, tuple)) and 0 < len(value) <= MAX_LIST:
        if all(isinstance(each, str) for each in value):
            return np.array(value)
        if all(isinstance(each, (int, float)) for each in value):
            return np.array(value, dtype=float)
    return None
