"""Content-addressed blobs: a blob's name is the digest of its bytes, so a double write is harmless."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import FileError
from pipeline.files import atomic, digest


@dataclass(frozen=True, kw_only=True)
class BlobStore:
    """Blobs below `root`, as `<first two hex digits>/<digest>`."""

    root: Path

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

    def put(self, data: bytes) -> str:
        """Store `data`, also over a blob of that name that was damaged; its digest."""
        blob = digest.of_bytes(data)
        if not self.is_whole(blob):
            atomic.write_bytes(self.path(blob), data)
        return blob

    def take(self, path: Path) -> str:
        """Move a file of the same disk into the store, whole and synced already; its digest."""
        blob = digest.of_file(path)
        if self.is_whole(blob):
            path.unlink()
        else:
            self.path(blob).parent.mkdir(parents=True, exist_ok=True)
            path.replace(self.path(blob))
        return blob

    def get(self, blob: str) -> bytes:
        """Bytes of a blob. Raises FileError when it is missing or its content is not its name."""
        path = self.path(blob)
        do = "Materialize again: what is damaged or gone is made again."
        if not path.is_file():
            raise FileError(path, "the blob is missing.", do)
        data = path.read_bytes()
        if digest.of_bytes(data) != blob:
            raise FileError(path, "the blob's content does not match its name.", do)
        return data
