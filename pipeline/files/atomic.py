"""Writes that are whole or not there: aside, synced, then renamed, and the rename synced.

The memo of the batch layer and its blobs do without: what is lost or torn by a power cut is made again.
"""

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

from pipeline.errors import FileError

READABLE = 0o644
"""Permissions of a file that is written: everybody may read it."""


def write_bytes(path: Path, data: bytes, mode: int = READABLE, *, synced: bool = True) -> None:
    """`write_parts` of one part."""
    write_parts(path, [data], mode, synced=synced)


def write_parts(path: Path, parts: Iterable[bytes], mode: int = READABLE, *, synced: bool = True) -> None:
    """Write `parts`, one after the other, to `path` so that a reader sees the old file or the new one, never a part.

    The new name is on the disk when this returns, so that what is written later can't survive a power cut that this
    does not; without `synced` a power cut may tear or lose it. Raises FileError (with the free space) when the disk
    refuses, and what `parts` raises; the old file stays then, unless it was the folder that could not be synced.
    """
    aside: str | None = None
    try:
        made = _missing_folders(path.parent) if synced else []
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, aside = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
        with os.fdopen(handle, "wb") as stream:
            stream.writelines(parts)
            if synced:
                stream.flush()
                os.fsync(stream.fileno())
        Path(aside).chmod(mode)
        Path(aside).replace(path)
        for folder in (path.parent, *(each.parent for each in made)) if synced else ():
            _sync_folder(folder)
    except BaseException as error:
        if aside is not None:
            with contextlib.suppress(OSError):
                Path(aside).unlink(missing_ok=True)
        if not isinstance(error, OSError):
            raise
        raise FileError(path, f"could not be written ({error}); {_room(path.parent)}") from error


def _room(folder: Path) -> str:
    """What is left for files in a folder, or in the first above it that can be asked."""
    for each in (folder, *folder.parents):
        with contextlib.suppress(OSError):
            stats = os.statvfs(each)
            names = " and no more names" if stats.f_files and not stats.f_favail else ""
            return f"{stats.f_bavail * stats.f_frsize / 1e6:.0f} MB{names} are free."
    return "the free space can't be read."


def _missing_folders(folder: Path) -> list[Path]:
    """`folder` and those above it that are not there yet."""
    missing = []
    while not folder.exists():
        missing.append(folder)
        folder = folder.parent
    return missing


def _sync_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk, where the file system can."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(handle)


def write_text(path: Path, text: str) -> None:
    """`write_bytes` of UTF-8 text."""
    write_bytes(path, text.encode())
