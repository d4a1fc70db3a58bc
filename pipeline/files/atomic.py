"""Writes that are whole or not there: aside, synced, then renamed."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from pipeline.errors import FileError


def write_bytes(path: Path, data: bytes) -> None:
    """Write `data` to `path` so that a reader sees the old file or the new one, never a part.

    Raises FileError (with the free space) when the disk refuses; the old file stays then.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, aside = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        Path(aside).chmod(0o644)
        Path(aside).replace(path)
    except OSError as error:
        Path(aside).unlink(missing_ok=True)
        stats = os.statvfs(path.parent)
        free_mb = stats.f_bavail * stats.f_frsize / 1e6
        raise FileError(path, f"could not be written ({error}); {free_mb:.0f} MB are free.") from error


def write_text(path: Path, text: str) -> None:
    """`write_bytes` of UTF-8 text."""
    write_bytes(path, text.encode())
