"""Content digests: of bytes, files, folders and JSON values. SHA-256, hex."""

import hashlib
import json
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

THREADS, A_THREAD = 4, 64
"""Number of threads that read files, and files per task."""


def of_bytes(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def of_file(path: Path | str) -> str:
    with open(path, "rb", buffering=0) as stream:  # noqa: PTH123, asked for each clip of each stage
        return hashlib.file_digest(stream, "sha256").hexdigest()


def of_file_or_fault(path: Path) -> str:
    """Digest of a file, or of the error if it can't be read."""
    try:
        return of_file(path)
    except OSError as error:
        return of_json(["unreadable", error.errno])


def of_each(paths: Sequence[Path]) -> list[str]:
    """Digest of each file, computed in several threads. Raises OSError."""
    parts = [paths[first : first + A_THREAD] for first in range(0, len(paths), A_THREAD)]
    with ThreadPoolExecutor(THREADS) as pool:
        return [found for part in pool.map(lambda part: list(map(of_file, part)), parts) for found in part]


def of_json(value: object) -> str:
    """Digest of a JSON value; key order does not matter, NaN is refused."""
    return of_bytes(json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False).encode())


def of_files(paths: list[Path], root: Path) -> str:
    """Digest of the named files' contents and their paths below `root`; their order does not matter."""
    return of_json(sorted((path.relative_to(root).as_posix(), of_file(path)) for path in paths))
