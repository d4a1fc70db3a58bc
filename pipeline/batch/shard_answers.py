"""A stage, its questions about clips, and the answers about all clips of a shard: rows that are stored and recalled
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
    """What is run on each clip, and what its answer depends on."""

    name: str
    version: str
    """Code version: digest of the sources the answer depends on."""
    function: Callable[..., Outcome]
    """`function(clip, numbers) -> Outcome`; for files `function(path, *arguments) -> Outcome`. Must be importable."""
    prepare: Callable[..., Any] | None = None
    """`prepare(clip)`: what is alike for all windows of a clip. It is worked out once for clips of the same motion,
    which then go to one process, and `function` gets it as `prepared`. Must be importable."""
    together: Callable[[str], str] | None = None
    """Of a clip's name: what the names of clips that `prepare` is for have in common; without it, their motion."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Plain settings, for key and provenance."""
    depends: dict[str, str] = field(default_factory=dict)
    """What else the answer depends on, by digest (the robot)."""
    robot: str = ""
    """Whose motions it makes; empty for what all robots share."""

    @property
    def asker(self) -> str:
        """By what `pipeline.batch.collect` counts its runs: those of one robot say nothing about another's."""
        return f"{self.robot}/{self.name}" if self.robot else self.name

    @cached_property
    def settings_digest(self) -> str:
        return digest.of_json({"settings": self.settings, "depends": self.depends})

    def group_of(self, entry: Entry) -> str:
        """What clips that are worked on one after the other in one process have in common."""
        if self.together is not None:
            return self.together(entry.clip)
        return entry.blob if self.prepare else entry.clip

    def key(self, *question: Any) -> str:
        """Memo key of a question (JSON values)."""
        return digest.of_json([self.name, self.version, self.settings_digest, *question])


@dataclass(frozen=True, kw_only=True)
class Job:
    """One question: what the judged row is called, its memo key, what it is about, what to carry on."""

    clip: str
    key: str
    about: Any
    group: str
    """Jobs of one group are worked on by one call, one after the other."""
    numbers: dict[str, Any] = field(default_factory=dict)
    record: tuple[dict[str, Any], ...] = ()


@dataclass(frozen=True, kw_only=True)
class ShardResult:
    """What is known of the answers about one shard."""

    entries: tuple[Shard[Entry], ...]
    clips: tuple[str, ...]
    """Names of the entries."""
    judged: tuple[Shard[Judged], ...]
    unsound: tuple[tuple[str, str], ...]
    recomputed: int = 0


WHOLE = 2 * CUT_EVERY
"""Rows that are made of one shard are one again up to this number."""


def recalled(key: str, stage: Stage, store: Store) -> ShardResult | None:
    """The remembered answers about a shard, if all that they name is there and unchanged."""
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
    """The rows that the answers about a shard make, stored and remembered where none of them is a fault."""
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
    """The clips that go on from one answer."""
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
