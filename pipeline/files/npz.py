"""Untrusted array archives of NumPy and torch, with sizes and checksums checked before data are read.

NumPy object arrays are never read. torch decompresses any claimed size and does not verify the checksums of
memory-mapped data; `check_torch_archive` does both.
"""

import errno
import lzma
import pickle
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.errors import FileError
from pipeline.files import page_memory
from pipeline.files.array_file import ArrayFile

DAMAGED_NPZ = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, OSError, ValueError, RuntimeError)
"""Errors of zipfile, its decompressors and NumPy for archives that are damaged, encrypted or have an unknown
compression; none is a FileError."""

DAMAGED_FILE = (
    *(ArithmeticError, AssertionError, AttributeError, LookupError, NameError, TypeError),
    *(struct.error, pickle.UnpicklingError, *DAMAGED_NPZ),
)
"""Errors of libraries that read a damaged pickle or C3D file; an OSError of the disk is raised again."""

OF_THE_FILE = (None, errno.EINVAL)
"""Error numbers of an OSError that a damaged archive causes: bz2 states none, a seek to before the start is invalid."""


def raise_fault_of_disk(error: Exception) -> None:
    """Raise an error again if it comes from the disk or the system and not from the file: EIO, EACCES, EMFILE."""
    if isinstance(error, OSError) and error.errno not in OF_THE_FILE:
        raise error


@contextmanager
def reported_damage(path: Path, what: str, do: str = "") -> Iterator[None]:
    """Convert a library's errors on a damaged file to one FileError: `it is not <what> that can be read`."""
    try:
        yield
    except DAMAGED_FILE as error:
        raise_fault_of_disk(error)
        message = first_words(f"{type(error).__name__} {error}")
        raise FileError(path, f"it is not {what} that can be read: {message}.", do) from error


MOST_MEMBERS = 1_000
"""Most members of an archive."""
MOST_RATIO = 1_000
"""Largest ratio of decompressed to compressed size of a member."""
MOST_BYTES = 2_000_000_000
"""Largest decompressed size of all members together [bytes]."""


@dataclass(frozen=True, kw_only=True)
class NpzHeader(ArrayFile):
    """Content of an archive, from its headers."""

    path: Path
    shapes: Mapping[str, tuple[int, ...]]
    """Shape of each array that can be read: numbers and text, no objects."""
    objects: tuple[str, ...]
    """Names of the object arrays; they are never read."""
    numeric: frozenset[str]
    """Names of the arrays of numbers."""

    def stored(self, name: str) -> np.ndarray:
        """One array as stored. Raises FileError: missing, damaged or of objects; OSError for a fault of the disk."""
        if name in self.objects:
            raise FileError(self.path, f"'{name}' is an array of Python objects, which is never loaded.")
        if name not in self.shapes:
            raise FileError(self.path, f"'{name}' is missing; there are: {', '.join(sorted(self.shapes))}.")
        try:
            with zipfile.ZipFile(self.path) as archive:
                return _read_member(archive, name)
        except DAMAGED_NPZ as error:
            raise_fault_of_disk(error)
            raise FileError(self.path, f"'{name}' can't be read: {first_words(str(error))}.") from error


def read_npz_header(path: Path, most_bytes: int = MOST_BYTES) -> NpzHeader:
    """Read the header of an archive. Raises FileError if it is not an archive, damaged, or too large when decompressed;
    OSError on disk errors."""
    if not path.is_file():
        raise FileError(path, "the file does not exist.")
    if path.stat().st_size == 0:
        raise FileError(path, "the file is empty.")
    shapes: dict[str, tuple[int, ...]] = {}
    objects: list[str] = []
    numeric: set[str] = set()
    try:
        with zipfile.ZipFile(path) as archive:
            check_sizes(path, archive.infolist(), most_bytes)
            for info in archive.infolist():
                name = info.filename.removesuffix(".npy")
                with archive.open(info) as stream:
                    shape, _, dtype = _header(stream)
                if dtype.hasobject:
                    objects.append(name)
                elif int(np.prod(shape, dtype=object)) * dtype.itemsize > info.file_size:
                    raise FileError(path, f"'{name}' claims shape {shape}, more than its {info.file_size} bytes hold.")
                else:
                    shapes[name] = shape
                    numeric |= {name} if dtype.kind in "fiub" else set()
    except DAMAGED_NPZ as error:
        raise_fault_of_disk(error)
        raise FileError(path, f"it is not a NumPy archive that can be read: {first_words(str(error))}.") from error
    return NpzHeader(path=path, shapes=shapes, objects=tuple(objects), numeric=frozenset(numeric))


def first_words(text: str) -> str:
    """The beginning of an error's text in ASCII; zipfile prints whole members."""
    return " ".join(text[:120].encode("ascii", "replace").decode().split())


def check_sizes(path: Path, members: list[zipfile.ZipInfo], most_bytes: int = MOST_BYTES) -> None:
    if len(members) > MOST_MEMBERS:
        raise FileError(path, f"the archive has {len(members)} members, more than the {MOST_MEMBERS} allowed.")
    for info in members:
        if info.file_size > MOST_RATIO * max(info.compress_size, 1_000):
            problem = (
                f"'{info.filename[:60]}' inflates from {info.compress_size} to {info.file_size} bytes, not allowed."
            )
            raise FileError(path, problem)
    total = sum(info.file_size for info in members)
    if total > most_bytes:
        raise FileError(path, f"the archive inflates to {total} bytes, more than the {most_bytes} allowed.")


def _header(stream: page_memory.Readable) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape of an array, whether its columns come first, and its type."""
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    return read(stream)


def _read_member(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    """One array, read into memory of its own. Raises what a damaged archive raises."""
    member = f"{name}.npy" if f"{name}.npy" in archive.namelist() else name
    with archive.open(member) as stream:
        shape, columns_first, dtype = _header(stream)
        array = page_memory.empty(shape[::-1] if columns_first else shape, dtype)
        page_memory.fill(array, stream)
        if stream.read(1):
            raise ValueError("it holds more than its shape states")
    return array.T if columns_first else array


def check_torch_archive(path: Path, most_bytes: int) -> tuple[str, ...]:
    """Names of an archive's members.

    Raises FileError for what is no zip archive (torch wrote others before 1.6; their pickles claim sizes for which
    torch takes memory before it reads), is damaged, or is too large when inflated; OSError for a fault of the disk.
    """
    size = path.stat().st_size
    if size > most_bytes:
        raise FileError(path, f"has {size} bytes, more than the {most_bytes} allowed.")
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            check_sizes(path, members, most_bytes)
            damaged = archive.testzip()
    except DAMAGED_NPZ as error:
        raise_fault_of_disk(error)
        raise FileError(path, f"is no archive of torch that can be read ({str(error)[:120]}).") from error
    if damaged is not None:
        raise FileError(path, f"is damaged: '{damaged[:60]}' has another checksum than the archive states.")
    return tuple(info.filename for info in members)
