"""Content-addressed blobs: a blob's name is the digest of its bytes, so a repeated write is harmless.

Digests are cached by size, modification time, inode change time and inode number. Programs can't set the inode change
time, so a file that was changed in place with a restored modification time is read again.
"""

import contextlib
import json
import os
import time
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import FileError
from pipeline.files import atomic, digest
from pipeline.files.remote_blobs import BlobGoneError, RemoteBlobs

SETTLED_NS = 2_000_000_000
"""Age since the last change below which a digest is not cached [ns], as the file could change again within one clock
tick."""


class DigestMemory:
    """Cache of file digests, stored in a file; an unreadable cache file counts as empty."""

    def __init__(self, path: Path):
        self._path = path
        try:
            known = json.loads(path.read_text())
        except (OSError, ValueError, RecursionError):
            known = {}
        self._known: dict[str, list] = known if isinstance(known, dict) else {}
        self._used: dict[str, list] = {}

    def of(self, path: Path | str) -> str:
        """Digest of a file's content. Raises OSError."""
        name = str(path)
        stat = os.stat(name)  # noqa: PTH116, asked for each clip of each stage
        state = _state(stat)
        for known in (self._used.get(name), self._known.get(name)):
            if isinstance(known, list) and known[:-1] == state and isinstance(known[-1], str):
                break
        else:
            known = [*state, digest.of_file(Path(name))]
            if _state(Path(name).stat()) != state or time.time_ns() - stat.st_ctime_ns < SETTLED_NS:
                self._used.pop(name, None)
                return known[-1]
        self._used[name] = known
        return known[-1]

    def note(self, path: str, state: list[int], found: str) -> None:
        """Add a digest computed by another process, for a file with this `settled_state` before it was read."""
        self._used[path] = [*state, found]

    def save(self) -> None:
        """Save the digests used since this object was created; the others belong to deleted files."""
        if self._used != self._known:
            atomic.write_text(self._path, json.dumps(self._used, sort_keys=True))
            self._known = dict(self._used)


def settled_state(path: str) -> list[int]:
    """Cache key of a file: size, times of change [ns], inode; empty for one that changed just now, as its next change
    may have the same times. Raises OSError."""
    stat = os.stat(path)  # noqa: PTH116, asked for each clip of each stage
    return _state(stat) if time.time_ns() - stat.st_ctime_ns >= SETTLED_NS else []


def _state(stat: os.stat_result) -> list[int]:
    return [stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns, stat.st_ino]


class StoreError(FileError):
    """Raised for a blob that is missing, damaged or not copied: an error of the store, not of the clip."""


@dataclass(frozen=True, kw_only=True)
class BlobStore:
    """Blobs below `root`, as `<first two hex digits>/<digest>`, including copies of blobs at a URL."""

    root: Path
    remote: RemoteBlobs | None = None
    """Blobs shared with other machines; None if there is only `root`."""

    def path(self, blob: str) -> Path:
        return self.root / blob[:2] / blob

    def has(self, blob: str) -> bool:
        return self.path(blob).is_file()

    def is_whole(self, blob: str) -> bool:
        """Whether the blob exists and its content matches its name. Reads it."""
        try:
            return self.has(blob) and digest.of_file(self.path(blob)) == blob
        except OSError:
            return False

    def _has_bytes(self, blob: str, data: bytes) -> bool:
        """Whether the blob's file has these bytes; comparing takes less time than a digest."""
        try:
            return self.path(blob).read_bytes() == data
        except OSError:
            return False

    def put(self, data: bytes) -> str:
        """Store `data`, replacing a damaged blob of that name; return its digest.

        It is not synced: a blob damaged by a power failure does not match its name, and is recomputed.
        """
        blob = digest.of_bytes(data)
        if not self._has_bytes(blob, data):
            atomic.write_unsynced(self.path(blob), data)
        if self.remote is not None:
            self.remote.put(data)
        return blob

    def take(self, path: Path) -> str:
        """Move a complete and synced file (same file system) into the store; return its digest."""
        blob = digest.of_file(path)
        if self.remote is not None:
            self.remote.put(path.read_bytes())
        if self.is_whole(blob):
            path.unlink()
        else:
            self.path(blob).parent.mkdir(parents=True, exist_ok=True)
            path.replace(self.path(blob))
        return blob

    def get(self, blob: str) -> bytes:
        """Bytes of a blob. Raises StoreError if it is missing or does not match its name.

        A blob that does not match is removed, so that no cached digest counts it as valid: a power failure may leave a
        file with its size and times but without its content.
        """
        path = self.path(blob)
        do = "Materialize again: what is damaged or gone is made again."
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            if not self.copied(blob):
                where = f" here and at {self.remote.url}" if self.remote else ""
                raise StoreError(path, f"the blob is missing{where}.", do) from None
            data = path.read_bytes()
        if digest.of_bytes(data) != blob:
            with contextlib.suppress(OSError):  # a store that is only read
                path.unlink()
            raise StoreError(path, "the blob's content does not match its name.", do)
        return data

    def copied(self, blob: str) -> bool:
        """Copy a blob from the URL; False if it does not exist there, or there is no URL.

        Raises StoreError on disk errors.
        """
        if self.remote is None:
            return False
        try:
            data = self.remote.get(blob)
        except BlobGoneError:
            return False
        try:
            atomic.write_bytes(self.path(blob), data)
        except FileError as error:
            raise StoreError(error.path, error.problem, error.do) from error
        return True
