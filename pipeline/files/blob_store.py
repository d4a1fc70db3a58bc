"""Content-addressed blobs: a blob's name is the digest of its bytes, so a double write is harmless.

A file is known by size, times of change and inode. The time of its inode's change is the system's own: no program sets
it, so that a file changed in place and given its old time back is read again.
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
"""A file that changed less than this ago [ns] is not remembered: it could change again within one tick of the clock."""


class DigestMemory:
    """Digests of files, remembered in a file of their own; what is not readable there counts as nothing."""

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
        """Note the digest that another process found of a file, which had this `settled_state` before it was read."""
        self._used[path] = [*state, found]

    def save(self) -> None:
        """Keep what was looked up since this was made; the rest is of deleted files."""
        if self._used != self._known:
            atomic.write_text(self._path, json.dumps(self._used, sort_keys=True))
            self._known = dict(self._used)


def settled_state(path: str) -> list[int]:
    """What a file is known by: size, times of change [ns], inode; nothing of one that changed just now, as its next
    change may have the same times. Raises OSError."""
    stat = os.stat(path)  # noqa: PTH116, asked for each clip of each stage
    return _state(stat) if time.time_ns() - stat.st_ctime_ns >= SETTLED_NS else []


def _state(stat: os.stat_result) -> list[int]:
    return [stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns, stat.st_ino]


class StoreError(FileError):
    """A blob that is missing, damaged or not copied: a fault of the store, none of the clip that needs the blob."""


@dataclass(frozen=True, kw_only=True)
class BlobStore:
    """Blobs below `root`, as `<first two hex digits>/<digest>`; of those at a URL, copies."""

    root: Path
    remote: RemoteBlobs | None = None
    """Where other machines read and write blobs, too; None where `root` is all there is."""

    def path(self, blob: str) -> Path:
        return self.root / blob[:2] / blob

    def has(self, blob: str) -> bool:
        return self.path(blob).is_file()

    def is_whole(self, blob: str) -> bool:
        """Whether the blob is there and its content is its name. Reads it."""
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
        """Store `data`, also over a blob of that name that was damaged; its digest.

        It is not forced to the disk: one that a power cut tears does not have its name's digest, and is made again.
        """
        blob = digest.of_bytes(data)
        if not self._has_bytes(blob, data):
            atomic.write_unsynced(self.path(blob), data)
        if self.remote is not None:
            self.remote.put(data)
        return blob

    def take(self, path: Path) -> str:
        """Move a file of the same disk into the store, whole and synced already; its digest."""
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
        """Bytes of a blob. Raises StoreError when it is missing or its content is not its name.

        A blob of other content is removed, so that no remembered digest counts it as whole: a power cut may leave a
        file its size and times without its content.
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
        """Copy a blob from the URL; False where it is not there, or there is none.

        Raises StoreError when the disk refuses the copy.
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
