"""Named arrays of a file of any format, checked on access."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pipeline.errors import FileError
from pipeline.files import page_memory

ROWS_AT_ONCE = 4096
"""Rows per batch of a conversion, which limits the memory for intermediate results."""

LARGEST = 1e9
"""Largest plausible number of a motion in any unit; larger ones count as missing, like NaN and infinity."""


def known_numbers(values: np.ndarray) -> np.ndarray:
    """Replace values that are not finite or exceed `LARGEST` by NaN."""
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(values) <= LARGEST, values, np.nan)


class ArrayFile(ABC):
    """Named arrays of a file."""

    path: Path
    shapes: Mapping[str, tuple[int, ...]]
    """Shape of each array that can be read: numbers and text, no objects."""

    @abstractmethod
    def stored(self, name: str) -> np.ndarray:
        """One array as stored. Raises FileError if it is missing, damaged or has objects."""

    def array(self, name: str) -> np.ndarray:
        """One array; numbers as float64. Raises FileError if it is missing, damaged or has objects."""
        value = self.stored(name)
        return value.astype(float) if value.dtype.kind in "fiu" else value

    def has(self, *names: str) -> bool:
        """Whether all of the names exist."""
        return all(name in self.shapes for name in names)

    def first(self, *names: str) -> str | None:
        """The first of the names that exists."""
        return next((name for name in names if name in self.shapes), None)

    def numbers(self, name: str, *shape: int | None) -> np.ndarray:
        """A float array whose shape is `shape` (None: any length); values that are not finite or too large become
        NaN."""
        value = self.stored_numbers(name, *shape)
        found = page_memory.empty(value.shape)
        for start in range(0, len(value), ROWS_AT_ONCE):
            found[start : start + ROWS_AT_ONCE] = finite_rows(value, start, start + ROWS_AT_ONCE)
        return found

    def stored_numbers(self, name: str, *shape: int | None) -> np.ndarray:
        """An array of numbers of that shape as stored (for `finite_rows`). Raises FileError for any other."""
        value = self.stored(name)
        fits = len(shape) == value.ndim and all(
            length in (None, rows) for length, rows in zip(shape, value.shape, strict=True)
        )
        if value.dtype.kind not in "fiu" or not fits:
            expected = "×".join("n" if length is None else str(length) for length in shape)
            got = "×".join(map(str, value.shape))
            problem = f"'{name}' is of {value.dtype} with shape {got}, expected {expected} numbers."
            raise FileError(self.path, problem)
        return value

    def refuse_other_length(self, name: str, than: str, frames: int) -> None:
        """Raise FileError if the array `name` exists and does not have `frames` rows, as the array `than` has."""
        shape = self.shapes.get(name, (frames,))
        if not shape or shape[0] != frames:
            problem = f"'{name}' has {shape[0] if shape else 'no'} rows and '{than}' has {frames}."
            raise FileError(self.path, problem, "Frames were lost or added; export it again.")

    def number(self, name: str) -> float:
        """An array of one finite number."""
        value = self.array(name)
        if value.size != 1 or value.dtype.kind != "f" or not np.isfinite(value).all():
            raise FileError(self.path, f"'{name}' is not one finite number.")
        return float(value.reshape(-1)[0])

    def optional_number(self, *names: str) -> float | None:
        """The number of the first name that exists."""
        name = self.first(*names)
        return None if name is None else self.number(name)

    def optional_texts(self, *names: str) -> tuple[str, ...] | None:
        """The list of names of the first name that exists."""
        name = self.first(*names)
        return None if name is None else self.texts(name)

    def texts(self, name: str) -> tuple[str, ...]:
        """A list of names."""
        value = self.array(name)
        if value.dtype.kind != "U" or value.ndim != 1:
            raise FileError(self.path, f"'{name}' is not a list of names.")
        return tuple(str(entry) for entry in value)


def finite_rows(value: np.ndarray, start: int, stop: int) -> np.ndarray:
    """Rows [start, stop) of an array of numbers as float64; values that are not finite or too large become NaN."""
    with np.errstate(invalid="ignore"):  # signalling NaN
        return known_numbers(value[start:stop].astype(float))
