"""What of the store no run needs any more: old answers, and blobs that only they name.

Kept are all blobs that a manifest names, and the answers that the last few runs of each stage asked for, with their
blobs. Databases and their earlier versions are folders of their own and name no blob; the curator's decisions name
clips of the manifests. Whatever is removed is made again when it is wanted.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from pipeline.batch.store import LOCK, STAGE, Store
from pipeline.errors import FileError, PipelineError
from pipeline.files.remote_blobs import RemoteBlobs

_DIGEST = re.compile(rb"\b[0-9a-f]{64}\b")


class StoreInUseError(PipelineError):
    """A run works on the store."""

    def __init__(self, root: Path, holder: str):
        super().__init__(f"{root}: {holder or 'a run'} is working on the store; try again when it has finished.")


@dataclass(frozen=True, kw_only=True)
class Part:
    """Files of one kind in the store."""

    what: str
    files: int
    size: int
    """[bytes]"""
    old: tuple[Path, ...] | tuple[str, ...]
    """Those that no run needs; of a URL their names."""
    old_size: int
    """[bytes]"""


def collect(store: Store, keep: int, *, delete: bool) -> tuple[Part, ...]:
    """Find, and on demand delete, what no run needs; each kind of file with its size.

    Raises StoreInUseError while a run works on the store, FileError for a file that can't be deleted.

    Args:
        keep: of each stage, the answers that its last `keep` runs asked for are kept
        delete: delete the old files; otherwise nothing is changed
    """
    with _alone(store.root):
        answers, needed = _answers(store, keep)
        for path in (store.root / "manifests").rglob("*.json"):
            needed |= _named(path.read_bytes())
        blobs = list(_files(store.own_blobs.root))
        old_blobs = [path for path in blobs if path.name.encode() not in needed]
        parts = (
            _part("answers", [path for path, _ in answers], [path for path, is_kept in answers if not is_kept]),
            _part("blobs of clips", blobs, old_blobs),
            *(_part(name, list(_files(store.root / name)), []) for name in ("manifests", "thumbnails")),
            *_at_url(store.own_blobs.remote, needed),
        )
        if delete:
            for each in (each for part in parts for each in part.old):
                _remove(each, store.own_blobs.remote)
    return parts


def _answers(store: Store, keep: int) -> tuple[list[tuple[Path, bool]], set[bytes]]:
    """Each file of the memo and whether it is kept, and the blobs that kept answers name."""
    since = {stage: times[-keep] for stage, times in store.askings().items() if len(times) >= keep}
    found, needed = [], set()
    for path in _files(store.root / "memo"):
        text = path.read_bytes()
        stage = _stage_of(text) if path.suffix == ".json" else None
        is_kept = stage is not None and path.stat().st_mtime_ns >= since.get(stage, 0)
        if is_kept:
            needed |= _named(text)
        found.append((path, is_kept))
    return found, needed


def _stage_of(text: bytes) -> str | None:
    """The stage whose answer this is; None for what no stage of this version asks for: a torn or an older answer."""
    try:
        stage = json.loads(text).get(STAGE)
    except (ValueError, AttributeError, RecursionError):
        return None
    return stage if isinstance(stage, str) else None


def _named(text: bytes) -> set[bytes]:
    return set(_DIGEST.findall(text))


def _files(folder: Path) -> Iterator[Path]:
    return (path for path in sorted(folder.rglob("*")) if path.is_file())


def _part(what: str, files: Iterable[Path], old: Iterable[Path]) -> Part:
    size = {path: path.stat().st_size for path in files}
    gone = tuple(old)
    return Part(
        what=what, files=len(size), size=sum(size.values()), old=gone, old_size=sum(size[path] for path in gone)
    )


def _at_url(remote: RemoteBlobs | None, needed: set[bytes]) -> tuple[Part, ...]:
    """The blobs at the store's URL; none without one."""
    if remote is None:
        return ()
    size = remote.sizes()
    old = tuple(blob for blob in size if blob.encode() not in needed)
    old_size = sum(size[blob] for blob in old)
    return (Part(what=f"blobs at {remote.url}", files=len(size), size=sum(size.values()), old=old, old_size=old_size),)


def _remove(path: Path | str, remote: RemoteBlobs | None) -> None:
    """Delete a file, or the blob of a name at the URL."""
    if isinstance(path, str):
        assert remote is not None
        remote.remove(path)
        return
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise FileError(path, f"could not be deleted ({error}).") from error


@contextlib.contextmanager
def _alone(root: Path) -> Iterator[None]:
    """The lock that runs hold on the store, for as long as the context lasts. Raises StoreInUseError."""
    if not root.is_dir():
        raise FileError(root, "there is no store here.", "A run makes it: dagster asset materialize --select expert_db")
    with (root / LOCK).open("a+") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            stream.seek(0)
            raise StoreInUseError(root, stream.read().strip()) from error
        stream.truncate(0)
        stream.write("booster-lab store gc")
        stream.flush()
        yield
