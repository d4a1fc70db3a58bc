"""Atomic writes: write a temporary file, sync it, rename it, sync the folder.

Files that can be recomputed are written without syncing (`write_unsynced`): the memo of the batch layer, its blobs, and
shards until a manifest references them (`sync`).
"""

import contextlib
import errno
import fcntl
import os
import stat
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from pipeline.errors import FileError

READABLE = 0o644
"""Permissions of written files: readable by everybody."""


SYNCED_AT_A_TIME = 16
"""Number of threads for syncing."""


def write_bytes(path: Path, data: bytes, mode: int = READABLE) -> None:
    """`write_parts` of one part."""
    write_parts(path, [data], mode)


def write_parts(path: Path, parts: Iterable[bytes], mode: int = READABLE) -> None:
    """Write the concatenated `parts` to `path` atomically: a reader sees the old file or the new one.

    The rename is synced on return, so that no later write survives a power failure that this one does not. Raises
    FileError (with the free space) on disk errors, and the errors of `parts`; the old file is then unchanged, unless
    syncing the folder failed.
    """
    aside: str | None = None
    try:
        made = _missing_folders(path.parent)
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, aside = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
        with os.fdopen(handle, "wb") as stream:
            stream.writelines(parts)
            stream.flush()
            os.fsync(stream.fileno())
        Path(aside).chmod(mode)
        Path(aside).replace(path)
        for folder in (path.parent, *(each.parent for each in made)):
            _sync_path(folder)
    except BaseException as error:
        if aside is not None:
            with contextlib.suppress(OSError):
                Path(aside).unlink(missing_ok=True)
        if not isinstance(error, OSError):
            raise
        raise FileError(path, f"could not be written ({error}); {_room(path.parent)}") from error


@contextlib.contextmanager
def only_writer(path: Path) -> Iterator[None]:
    """Lock for read-modify-write access to the file; other writers wait. Creates its folder.

    The lock is on the folder, since each write replaces the file; so writers of two files of one folder wait for each
    other, and locks must not be nested. Raises FileError on disk errors.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(path.parent, os.O_RDONLY)
    except OSError as error:
        raise FileError(path, f"could not be written ({error}); {_room(path.parent)}") from error
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX)
        except OSError as error:
            raise FileError(path, f"its folder can't be locked ({error}).", "Keep it on a disk that can.") from error
        yield
    finally:
        os.close(handle)


def write_unsynced(path: Path | str, data: bytes, time_ns: int | None = None) -> None:
    """Write `data` so that a reader sees the old file or the new one; a power failure may damage or lose it.

    Raises FileError as `write_parts` does. Accepts strings as paths for speed, as it is called for each clip.

    Args:
        path: the file
        data: its content
        time_ns: its modification time since the epoch [ns]; default: now
    """
    folder, name = os.path.split(path)
    aside = f"{folder}/.{name}.{os.urandom(8).hex()}.part"  # machines that share a folder may have equal process ids
    try:
        try:
            stream = open(aside, "wb")  # noqa: PTH123, SIM115
        except FileNotFoundError:  # the first file of its folder
            os.makedirs(folder, exist_ok=True)  # noqa: PTH103
            stream = open(aside, "wb")  # noqa: PTH123, SIM115
        with stream:
            stream.write(data)
            os.fchmod(stream.fileno(), READABLE)
        if time_ns is not None:
            os.utime(aside, ns=(time_ns, time_ns))
        os.replace(aside, path)  # noqa: PTH105
    except BaseException as error:
        with contextlib.suppress(OSError):
            Path(aside).unlink(missing_ok=True)
        if not isinstance(error, OSError):
            raise
        raise FileError(Path(path), f"could not be written ({error}); {_room(Path(folder))}") from error


def sync(paths: Sequence[Path | str]) -> None:
    """Sync files and their folders to the disk, in parallel threads.

    Raises OSError.
    """
    folders = dict.fromkeys(os.path.dirname(path) for path in paths)  # noqa: PTH120
    with ThreadPoolExecutor(SYNCED_AT_A_TIME) as pool:
        for some in ([*paths], [*folders]):
            list(pool.map(_sync_all, (some[first::SYNCED_AT_A_TIME] for first in range(SYNCED_AT_A_TIME))))


def _sync_all(paths: Iterable[Path | str]) -> None:
    for path in paths:
        _sync_path(path)


def _room(folder: Path) -> str:
    """Free space of a folder, or of the nearest existing folder above it, as text."""
    for each in (folder, *folder.parents):
        with contextlib.suppress(OSError):
            stats = os.statvfs(each)
            names = " and no more names" if stats.f_files and not stats.f_favail else ""
            return f"{stats.f_bavail * stats.f_frsize / 1e6:.0f} MB{names} are free."
    return "the free space can't be read."


def _missing_folders(folder: Path) -> list[Path]:
    """`folder` and its ancestors that do not exist yet."""
    missing = []
    while not folder.exists():
        missing.append(folder)
        folder = folder.parent
    return missing


def _sync_path(path: Path | str) -> None:
    """Sync a file, or a folder's entries if the file system supports it."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP) or not stat.S_ISDIR(os.fstat(handle).st_mode):
            raise
    finally:
        os.close(handle)


def write_text(path: Path, text: str) -> None:
    """`write_bytes` of UTF-8 text."""
    write_bytes(path, text.encode())
