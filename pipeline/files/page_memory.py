"""Arrays in separately mapped memory, which can be released page by page while they are read for the last time."""

import math
import mmap
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import DTypeLike

LEAST_BYTES = 1 << 18
"""Size below which arrays are ordinary ones [bytes]."""
READ_BYTES = 1 << 20
"""Bytes that are read at once."""


@runtime_checkable
class Readable(Protocol):
    """A stream of bytes."""

    def read(self, size: int = -1, /) -> bytes:
        """The next bytes, at most `size`; empty at the end."""
        ...


def empty(shape: tuple[int, ...], dtype: DTypeLike = float) -> np.ndarray:
    """An array of zeros whose memory is allocated on write, and released by `forget` or with the array."""
    count = math.prod(shape)
    if count * np.dtype(dtype).itemsize < LEAST_BYTES:
        return np.zeros(shape, dtype=dtype)
    private = {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS} if hasattr(mmap, "MAP_PRIVATE") else {}
    memory = mmap.mmap(-1, count * np.dtype(dtype).itemsize, **private)
    return np.frombuffer(memory, dtype=dtype, count=count).reshape(shape)


def forget(array: np.ndarray, rows: int) -> None:
    """Release the memory of the first rows of an array made by `empty`, or of a view; they then read as zeros."""
    memory = _memory(array)
    if memory is None or not array.flags.c_contiguous or not array.size or not hasattr(mmap, "MADV_DONTNEED"):
        return
    start = array.ctypes.data - np.frombuffer(memory, dtype="u1").ctypes.data
    first = -(-start // mmap.PAGESIZE) * mmap.PAGESIZE
    stop = (start + min(rows, len(array)) * array.strides[0]) // mmap.PAGESIZE * mmap.PAGESIZE
    if stop > first:
        memory.madvise(mmap.MADV_DONTNEED, first, stop - first)


def fill(array: np.ndarray, stream: Readable) -> None:
    """Fill a contiguous array from a stream. Raises EOFError if it has too few bytes."""
    flat, done = array.reshape(-1).view("u1"), 0
    while done < len(flat):
        part = stream.read(min(READ_BYTES, len(flat) - done))
        if not part:
            raise EOFError("it was cut off")
        flat[done : done + len(part)] = np.frombuffer(part, dtype="u1")
        done += len(part)


def _memory(array: Any) -> mmap.mmap | None:
    """The mapped memory of an array or of the array that it is a view of; None for ordinary arrays."""
    while isinstance(array, (np.ndarray, memoryview)):
        array = array.base if isinstance(array, np.ndarray) else array.obj
    return array if isinstance(array, mmap.mmap) else None
