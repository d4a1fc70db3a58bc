"""Garbage collection of the store: old answers, and blobs that only these reference.

All shards referenced by a manifest are kept, with their blobs, and the answers used by the last few runs of each stage,
with their shards and blobs. Databases and their history are separate folders without references to blobs; the curator's
decisions refer to clips of the manifests. Everything that is removed can be recomputed.
"""

import contextlib
import fcntl
import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.batch.rows import Entry
from pipeline.batch.shard import Shard
from pipeline.batch.store import ANSWERS, LOCK, STAGE, Store
from pipeline.errors import FileError, PipelineError
from pipeline.files.remote_blobs import RemoteBlobs

_DIGEST = re.compile(rb"\b[0-9a-f]{64}\b")


class StoreInUseError(PipelineError):
    """Raised while a run uses the store."""

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
    """Files that no run needs; at a URL their names."""
    old_size: int
    """Total size of these files [bytes]."""


def collect(store: Store, keep: int, *, delete: bool) -> tuple[Part, ...]:
    """Find, and with `delete` remove, files that no run needs; return each kind of file with its size.

    Raises StoreInUseError while a run works on the store, FileError for a file that can't be deleted.

    Args:
        store: the store
        keep: number of last runs of each stage whose answers are kept
        delete: delete the old files; otherwise nothing is changed
    """
    with alone(store.root, "booster-lab store gc"):
        answers, needed = _answers(store, keep)
        for path in (store.root / "manifests").rglob("*.json"):
            needed |= _named(path.read_bytes())
        shards = list(_files(store.shards.root))
        for path in shards:
            if path.name.encode() in needed:
                needed |= _blobs_of(store, path.name)
        blobs = list(_files(store.own_blobs.root))
        parts = (
            _part("answers", [path for path, _ in answers], [path for path, is_kept in answers if not is_kept]),
            _part("blobs of clips", blobs, [path for path in blobs if path.name.encode() not in needed]),
            _part("shards of manifests", shards, [path for path in shards if path.name.encode() not in needed]),
            *(_part(name, list(_files(store.root / name)), []) for name in ("manifests", "thumbnails")),
            *_at_url(store.own_blobs.remote, needed),
        )
        if delete:
            for each in (each for part in parts for each in part.old):
                _remove(each, store.own_blobs.remote)
    return parts


def _answers(store: Store, keep: int) -> tuple[list[tuple[Path, bool]], set[bytes]]:
    """Each file of the memo and whether it is kept, and the shards and blobs that kept answers name.

    An answer about a shard replaces requests for those about its clips, which are kept with it.
    """
    since = {stage: times[-keep] for stage, times in store.askings().items() if len(times) >= keep}
    found: dict[Path, bool] = {}
    asked_together: set[str] = set()
    for path in _files(store.root / "memo"):
        answer = _answer(path)
        stage = None if answer is None else answer.get(STAGE)
        found[path] = isinstance(stage, str) and path.stat().st_mtime_ns >= since.get(stage, 0)
        if found[path] and answer is not None:
            asked_together |= set(map(str, answer.get(ANSWERS, ())))
    found = {path: is_kept or path.stem in asked_together for path, is_kept in found.items()}
    needed = {name for path, is_kept in found.items() if is_kept for name in _named(path.read_bytes())}
    return list(found.items()), needed


def _answer(path: Path) -> dict[str, Any] | None:
    """The answer in a file of the memo; None if it is incomplete."""
    try:
        answer = json.loads(path.read_bytes()) if path.suffix == ".json" else None
    except (ValueError, RecursionError):
        return None
    return answer if isinstance(answer, dict) else None


def _blobs_of(store: Store, shard: str) -> set[bytes]:
    """Blobs referenced by a shard of clips; none for findings or a damaged shard."""
    try:
        blobs = Shard(Entry, shard, 0, store.shards).columns(["blob"]).get("blob", ())
    except FileError:
        return set()
    return {blob.encode() for blob in blobs}


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
def alone(root: Path, holder: str) -> Iterator[None]:
    """Context that holds the store's lock; `holder` describes the lock holder in messages of waiting runs.

    Raises StoreInUseError while a run uses the store, FileError if the lock can't be written.
    """
    if not root.is_dir():
        raise FileError(root, "there is no store here.", "A run makes it: dagster asset materialize --select expert_db")
    try:
        stream = (root / LOCK).open("a+")
    except OSError as error:
        raise FileError(root / LOCK, f"the store can't be locked ({error}).") from error
    with stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            stream.seek(0)
            raise StoreInUseError(root, stream.read().strip()) from error
        stream.truncate(0)
        stream.write(holder)
        stream.flush()
        yield
