"""Blobs at a URL that several machines reach, such as `s3://bucket/booster-lab`, through fsspec."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from pipeline.errors import PipelineError
from pipeline.files import digest


class RemoteBlobError(PipelineError):
    """Raised for a URL that can't be used."""

    def __init__(self, url: str, problem: str, do: str):
        super().__init__(f"{url}: {problem} {do}")


class BlobGoneError(RemoteBlobError):
    """Raised for a blob that is missing or damaged at the URL."""


@dataclass(frozen=True, kw_only=True)
class RemoteBlobs:
    """Blobs below a URL, as `<first two hex digits>/<digest>`. Writes to object stores are atomic."""

    url: str

    def __getstate__(self) -> dict[str, Any]:
        return {"url": self.url}  # connections stay in their process

    @cached_property
    def _opened(self) -> tuple[Any, str]:
        """File system and folder."""
        try:
            import fsspec

            return fsspec.url_to_fs(self.url)
        except ImportError as error:
            do = "Install it; for s3:// that is: pip install 'booster-lab[cluster]' s3fs"
            raise RemoteBlobError(self.url, f"a library for it is missing ({error}).", do) from error
        except (ValueError, OSError) as error:
            raise RemoteBlobError(self.url, f"can't be opened ({error}).", "Check BOOSTER_LAB_BLOBS.") from error

    def _path(self, blob: str) -> str:
        return f"{self._opened[1]}/{blob[:2]}/{blob}"

    def sizes(self) -> dict[str, int]:
        """Size of each blob [bytes]."""
        files, folder = self._opened
        with self._reached():
            if not files.exists(folder):
                return {}
            found = files.find(folder, detail=True)
        return {path.rpartition("/")[2]: int(facts["size"]) for path, facts in sorted(found.items())}

    def put(self, data: bytes) -> str:
        """Store `data`; return its digest. An incomplete blob, which has another size, is replaced."""
        blob = digest.of_bytes(data)
        files, path = self._opened[0], self._path(blob)
        with self._reached():
            try:
                there = files.info(path)["size"] == len(data)
            except FileNotFoundError:
                there = False
            if not there:
                files.makedirs(path.rpartition("/")[0], exist_ok=True)
                files.pipe_file(path, data)
        return blob

    def get(self, blob: str) -> bytes:
        """Bytes of a blob. Raises BlobGoneError if it is missing or damaged; a damaged one is removed, so that it is
        recomputed."""
        do = "Materialize again: what is damaged or gone is made again."
        with self._reached():
            try:
                data = self._opened[0].cat_file(self._path(blob))
            except FileNotFoundError as error:
                raise BlobGoneError(self.url, f"the blob {blob} is missing.", do) from error
            if digest.of_bytes(data) != blob:
                self.remove(blob)
                raise BlobGoneError(self.url, f"the content of the blob {blob} does not match its name.", do)
        return data

    def remove(self, blob: str) -> None:
        with self._reached(), contextlib.suppress(FileNotFoundError):
            self._opened[0].rm_file(self._path(blob))

    @contextlib.contextmanager
    def _reached(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            do = "Check the network, the rights on it, and whether it is full."
            raise RemoteBlobError(self.url, f"does not answer as it should ({error}).", do) from error
