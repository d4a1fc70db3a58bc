"""The project's store on disk: blobs, memo, manifests and their shards.

Writes are atomic: a killed run leaves no partial file. Manifests and their shards also survive a power failure; blobs
and the memo are not synced, and are recomputed if a power failure loses them.
"""

import contextlib
import dataclasses
import itertools
import json
import os
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from pipeline.batch.code_version import code_version
from pipeline.batch.manifest import Manifest
from pipeline.batch.pool import ClipPool
from pipeline.batch.rows import Entry, Row
from pipeline.batch.shard import Rows, Shard
from pipeline.clips import codec
from pipeline.clips.outcome import Clip
from pipeline.errors import FileError
from pipeline.files import atomic, digest
from pipeline.files.blob_store import BlobStore, DigestMemory, settled_state
from pipeline.files.remote_blobs import BlobGoneError, RemoteBlobs

LOCK = "lock"
"""Lock file of the store."""

BLOBS_VARIABLE = "BOOSTER_LAB_BLOBS"
"""fsspec URL of a folder for blobs, for machines without a shared file system."""

STAGE = "stage"
"""Key of an answer: its stage."""

ANSWERS = "answers"
"""Key of a combined answer about a shard: memo keys of the answers about its clips."""

ROUND_TRIPS = "round_trips"
"""Stage name of the cached check that a shard's blobs round-trip."""

A_CALL = 32
"""Blobs per call of a checking process."""

MOST_ASKINGS = 100
"""Most runs of a stage that are recorded."""


@dataclass(frozen=True, kw_only=True)
class Store:
    """`blobs/` and `shards/` by content, `memo/` by question, `manifests/` by asset; below one folder.

    With a URL, blobs are stored there as well: worker processes read and write them only there, and this process keeps
    a copy of each blob that it reads.
    """

    root: Path
    blobs_url: str = field(default_factory=lambda: os.environ.get(BLOBS_VARIABLE, "").rstrip("/"))
    given: bool = field(default=False, repr=False, compare=False)
    """Whether the store was sent by another process, whose folder may be on another machine."""

    @property
    def blobs(self) -> BlobStore | RemoteBlobs:
        """Blob store for reading and writing clips."""
        return RemoteBlobs(url=self.blobs_url) if self.blobs_url and self.given else self.own_blobs

    @cached_property
    def own_blobs(self) -> BlobStore:
        """Blob store in this store's folder, backed by its URL."""
        remote = RemoteBlobs(url=self.blobs_url) if self.blobs_url else None
        return BlobStore(root=self.root / "blobs", remote=remote)

    @property
    def shared_folders(self) -> tuple[Path, ...]:
        """Folders that must be visible to a cluster's workers."""
        return () if self.blobs_url else (self.root,)

    def pool_of_files(self, pool: ClipPool) -> ClipPool:
        """The pool for stages on local files, which workers see only if they see the store's folder."""
        return pool.on_this_machine() if self.blobs_url else pool

    @property
    def shards(self) -> BlobStore:
        """Blob store of the manifests' shards."""
        return BlobStore(root=self.root / "shards")

    @cached_property
    def _digests(self) -> DigestMemory:
        return DigestMemory(self.root / "blob_digests.json")

    def __getstate__(self) -> dict[str, Any]:
        # Worker processes do not need the record of checked blobs.
        return {"root": self.root, "blobs_url": self.blobs_url, "given": True}

    def holds(self, blob: str, kind: str = "blobs") -> bool:
        """Whether a blob (or a file of `shards`) exists with the right content; an unchanged one is read only once."""
        try:
            return self._digests.of(self._file(blob, kind)) == blob
        except OSError:
            return kind == "blobs" and self.own_blobs.copied(blob)

    def _file(self, blob: str, kind: str = "blobs") -> str:
        return f"{self.root}/{kind}/{blob[:2]}/{blob}"

    def clips_of(self, shard: Shard[Entry]) -> list[str] | None:
        """The clips of a shard; None if its file or a referenced blob is missing or changed."""
        if not self.holds(shard.digest, "shards"):
            return None
        columns = shard.columns(["clip", "blob"])
        return columns["clip"] if all(map(self.holds, columns["blob"])) else None

    def put_shard(self, shard: Shard[Row]) -> Shard[Row]:
        """Store a shard; return it without its bytes in memory."""
        if isinstance(shard.place, bytes):
            self.shards.put(shard.place)
        return dataclasses.replace(shard, place=self.shards)

    def holds_blobs_of(self, asset: str) -> bool:
        """Whether everything that the current manifest of an asset references exists unchanged. Raises FileError."""
        manifest = self.load(asset)
        if not isinstance(manifest.entries, Rows):  # of an earlier version
            return all(self.holds(entry.blob) for entry in manifest.entries)
        judged = all(self.holds(shard.digest, "shards") for shard in manifest.judged_shards)
        with ThreadPoolExecutor(digest.THREADS) as pool:
            return judged and all(clips is not None for clips in pool.map(self.clips_of, manifest.entry_shards))

    def note_blobs(self) -> None:
        """Save the record of unchanged blobs for later runs. Raises FileError on disk errors."""
        self._digests.save()

    def put_clip(self, clip: Clip) -> str:
        """Store a clip's motion; return the digest of its blob."""
        return self.blobs.put(codec.encode(clip))

    def get_clip(self, blob: str, name: str) -> Clip:
        """Load the clip of a blob with a name."""
        return codec.decode(self.blobs.get(blob), name)

    def round_trips(self, blob: str) -> bool:
        """Whether a blob matches its digest, and its decoded clip encodes to the same bytes."""
        try:
            data = self.blobs.get(blob)
            return codec.encode(codec.decode(data, blob)) == data
        except (FileError, BlobGoneError, codec.CodecError):
            return False

    @cached_property
    def _asked_ns(self) -> dict[str, int]:
        return {}

    def _asking(self, stage: str) -> int:
        """Start time of this process's requests for a stage [ns], used as time of the requested answers."""
        if stage not in self._asked_ns:
            now = self._asked_ns[stage] = time.time_ns()
            times = self.askings()
            times[stage] = [*times.get(stage, []), now][-MOST_ASKINGS:]
            atomic.write_text(self._askings_path, json.dumps(times, sort_keys=True))
        return self._asked_ns[stage]

    def askings(self) -> dict[str, list[int]]:
        """Stage -> start times of its runs' requests [ns], the latest last."""
        try:
            found = json.loads(self._askings_path.read_text())
        except (OSError, ValueError, RecursionError):
            return {}
        return found if isinstance(found, dict) else {}

    @property
    def _askings_path(self) -> Path:
        return self.root / "askings.json"

    def damaged(self, manifest: Manifest, pool: ClipPool) -> Iterator[str]:
        """Clips of a manifest whose blobs do not round-trip; shards that passed before are not read again.

        Processes on this machine start immediately and are awaited at the first iteration.
        """
        version = code_version()
        unchecked: list[tuple[str, list[str], list[str]]] = []  # key of the answer, clips, blobs
        for shard in manifest.entry_shards:
            columns = shard.columns(["clip", "blob"])
            key = digest.of_json([ROUND_TRIPS, version, columns["blob"]])
            if self.recall(key, ROUND_TRIPS) is None:
                unchecked.append((key, columns["clip"], columns["blob"]))
        to_read = list(dict.fromkeys(blob for _, _, blobs in unchecked for blob in blobs))
        calls = [(to_read[first : first + A_CALL],) for first in range(0, len(to_read), A_CALL)]
        answers = pool.map(self._all_round_trip, calls, shared=self.shared_folders)
        return self._damaged(unchecked, zip(to_read, itertools.chain.from_iterable(answers), strict=True))

    def _damaged(
        self, unchecked: list[tuple[str, list[str], list[str]]], answers: Iterable[tuple[str, list[int] | None]]
    ) -> Iterator[str]:
        states = dict(answers)
        for blob, state in states.items():
            if state:  # already read completely: `holds` need not read it again
                self._digests.note(self._file(blob), state, blob)
        for key, _, blobs in unchecked:
            if all(states[blob] is not None for blob in blobs):
                self.remember(key, {"pieces": [{"blob": blob} for blob in blobs]}, ROUND_TRIPS)
        for _, clips, blobs in unchecked:
            yield from (clip for clip, blob in zip(clips, blobs, strict=True) if states[blob] is None)

    def _all_round_trip(self, blobs: list[str]) -> list[list[int] | None]:
        """Settled state of each blob's file (empty for one at a URL); None if it does not round-trip."""
        states = [
            [] if self.blobs_url or not self.own_blobs.has(blob) else settled_state(self._file(blob)) for blob in blobs
        ]
        return [state if self.round_trips(blob) else None for blob, state in zip(blobs, states, strict=True)]

    def recall(self, key: str, stage: str) -> dict[str, Any] | None:
        """Cached answer to a question of a stage, if all referenced blobs exist and are unchanged.

        The file's time is set to this run's request time, from which `pipeline.batch.collect` knows what is in use.

        Raises FileError on disk errors, since the answer may exist.
        """
        path, asked_ns = self._memo_path(key), self._asking(stage)
        try:
            with open(path, "rb") as stream:  # noqa: PTH123, called for each clip of each stage
                answer = json.loads(stream.read())
            blobs = [piece["blob"] for piece in answer["pieces"]]
        except (FileNotFoundError, ValueError, TypeError, KeyError, RecursionError):
            return None
        except OSError as error:
            raise FileError(path, f"could not be read ({error}).", "Check the disk that holds the store.") from error
        if not all(map(self.holds, blobs)):
            return None
        with contextlib.suppress(OSError):  # a read-only store
            os.utime(path, ns=(asked_ns, asked_ns))
        return answer

    def remember(self, key: str, answer: dict[str, Any], stage: str) -> None:
        """Cache the answer to a question of a stage, atomically.

        It is not synced, which would take longer than computing many an answer: one that a power failure damages is
        invalid JSON or missing, and is recomputed.
        """
        text = json.dumps({**answer, STAGE: stage}, sort_keys=True, allow_nan=False)
        atomic.write_unsynced(self._memo_path(key), text.encode(), self._asking(stage))

    def _memo_path(self, key: str) -> str:
        return f"{self.root}/memo/{key[:2]}/{key}.json"

    def manifest_path(self, asset: str) -> Path:
        """Path of an asset's manifest; `asset` is its key with slashes."""
        return self.root / "manifests" / f"{asset}.json"

    def save(self, asset: str, manifest: Manifest) -> None:
        """Save `manifest` as the asset's current one, after syncing its shards.

        Its blobs are already stored, but not synced: `holds_blobs_of` finds lost ones.
        """
        shards: tuple[Shard[Any], ...] = (*manifest.entry_shards, *manifest.judged_shards)
        for shard in shards:
            self.put_shard(shard)
        files = [self.shards.path(shard.digest) for shard in shards]
        folders = {self.shards.root, *(file.parent for file in files)} if files else ()
        try:
            atomic.sync([*files, *folders])
        except OSError as error:
            raise FileError(self.shards.root, f"could not be written ({error}).", "Is the disk full?") from error
        atomic.write_text(self.manifest_path(asset), manifest.to_text())

    def load(self, asset: str) -> Manifest:
        """The asset's current manifest. Raises FileError with the command to run."""
        path = self.manifest_path(asset)
        if not path.is_file():
            raise FileError(
                path, f"'{asset}' was never materialized here.", f"Run: dagster asset materialize --select {asset}"
            )
        try:
            return Manifest.from_text(path.read_text(), self.shards)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise FileError(path, f"not a readable manifest ({error}).", "Materialize the asset again.") from error
