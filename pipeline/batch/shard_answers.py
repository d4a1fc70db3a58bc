"""A stage, its questions about clips, and the combined answers about all clips of a shard, which are cached
together."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from pipeline.batch.rows import Entry, Judged
from pipeline.batch.shard import CUT_EVERY, Shard, shards_of
from pipeline.batch.store import ANSWERS, Store
from pipeline.clips.outcome import Outcome
from pipeline.files import digest


@dataclass(frozen=True, kw_only=True)
class Stage:
    """A function to run on each clip, and everything that its answers depend on."""

    name: str
    version: str
    """Code version: digest of the sources that the answer depends on."""
    function: Callable[..., Outcome]
    """`function(clip, numbers) -> Outcome`; for files `function(path, *arguments) -> Outcome`. Must be importable."""
    prepare: Callable[..., Any] | None = None
    """`prepare(clip)`: intermediate results shared by all windows of a clip. Computed once for clips of the same
    motion, which go to one process; `function` gets it as `prepared`. Must be importable."""
    together: Callable[[str], str] | None = None
    """Maps a clip's name to the key of clips that share `prepare`; None: clips with the same motion."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Plain settings, for key and provenance."""
    depends: dict[str, str] = field(default_factory=dict)
    """Digests of further dependencies of the answer (the robot)."""
    robot: str = ""
    """Robot of the resulting motions; empty if independent of the robot."""

    @property
    def asker(self) -> str:
        """Key by which `pipeline.batch.collect` counts runs, separately for each robot."""
        return f"{self.robot}/{self.name}" if self.robot else self.name

    @cached_property
    def settings_digest(self) -> str:
        return digest.of_json({"settings": self.settings, "depends": self.depends})

    def group_of(self, entry: Entry) -> str:
        """Key of clips that are processed together in one process."""
        if self.together is not None:
            return self.together(entry.clip)
        return entry.blob if self.prepare else entry.clip

    def key(self, *question: Any) -> str:
        """Memo key of a question (JSON values)."""
        return digest.of_json([self.name, self.version, self.settings_digest, *question])


@dataclass(frozen=True, kw_only=True)
class Job:
    """One question: name of the findings' row, memo key, subject, and data to pass on."""

    clip: str
    key: str
    about: Any
    group: str
    """Jobs of one group are processed sequentially by one call."""
    numbers: dict[str, Any] = field(default_factory=dict)
    record: tuple[dict[str, Any], ...] = ()


@dataclass(frozen=True, kw_only=True)
class ShardResult:
    """Combined result of the answers about one shard."""

    entries: tuple[Shard[Entry], ...]
    clips: tuple[str, ...]
    """Names of the entries."""
    judged: tuple[Shard[Judged], ...]
    unsound: tuple[tuple[str, str], ...]
    recomputed: int = 0


WHOLE = 2 * CUT_EVERY
"""Number of rows made from one shard up to which they stay one shard."""


def recalled(key: str, stage: Stage, store: Store) -> ShardResult | None:
    """Cached answers about a shard, if everything that they reference exists and is unchanged."""
    answer = store.recall(key, stage.asker)
    if answer is None:
        return None
    entries = tuple(Shard(Entry, name, count, store.shards) for name, count in answer["entries"])
    judged = tuple(Shard(Judged, name, count, store.shards) for name, count in answer["judged"])
    clips: list[str] = []
    for shard in entries:
        own = store.clips_of(shard)
        if own is None:
            return None
        clips += own
    if not all(store.holds(shard.digest, "shards") for shard in judged):
        return None
    unsound = tuple((clip, fault) for clip, fault in answer["unsound"])
    return ShardResult(entries=entries, clips=tuple(clips), judged=judged, unsound=unsound)


def result_of(
    stage: Stage,
    key: str,
    jobs: list[Job],
    answers: Mapping[str, dict[str, Any] | None],
    recomputed: int,
    store: Store,
) -> ShardResult:
    """Rows from the answers about a shard; stored and cached if none is a failure."""
    entries: list[Entry] = []
    judged: list[Judged] = []
    unsound: list[tuple[str, str]] = []
    failed = False
    for job in jobs:
        answer = answers[job.key]
        assert answer is not None
        entries += _entries(stage, job, answer)
        unsound += [(clip, fault) for clip, fault in answer["unsound"]]
        names = tuple(piece["clip"] for piece in answer["pieces"])
        judged.append(Judged(clip=job.clip, pieces=names, reasons=tuple(answer["reasons"]), numbers=answer["numbers"]))
        failed = failed or answer["failed"]
    result = ShardResult(
        entries=tuple(store.put_shard(shard) for shard in shards_of(Entry, entries, whole_up_to=WHOLE)),
        clips=tuple(entry.clip for entry in entries),
        judged=tuple(store.put_shard(shard) for shard in shards_of(Judged, judged, whole_up_to=WHOLE)),
        unsound=tuple(unsound),
        recomputed=recomputed,
    )
    if not failed:
        content = {
            "pieces": [],
            "entries": [[shard.digest, shard.count] for shard in result.entries],
            "judged": [[shard.digest, shard.count] for shard in result.judged],
            "unsound": unsound,
            ANSWERS: [job.key for job in jobs],
        }
        store.remember(key, content, stage.asker)
    return result


def _entries(stage: Stage, job: Job, answer: dict[str, Any]) -> list[Entry]:
    """Kept clips of one answer."""
    done = {
        "stage": stage.name,
        "version": stage.version,
        "settings": stage.settings_digest,
        "reasons": answer["reasons"],
    }
    record = (*job.record, done)
    return [
        Entry(clip=piece["clip"], blob=piece["blob"], numbers={**job.numbers, **piece["numbers"]}, record=record)
        for piece in answer["pieces"]
    ]
