"""Run a stage over clips: ask the memo, work on the rest in parallel, gather a manifest.

The memo's key is everything an answer depends on: stage code, settings, robot, the clip's bytes and
the numbers of earlier stages. So the same question is never worked on twice, in any run. The answers about all clips
of an unchanged shard are recalled together: one more clip costs what its own shard costs, of however many there are.
"""

import logging
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from pipeline.batch.again import clips_again
from pipeline.batch.answer import rejection, work_on_clips, work_on_files
from pipeline.batch.manifest import Manifest
from pipeline.batch.pool import ClipPool
from pipeline.batch.rows import Entry, Judged
from pipeline.batch.shard import CUT_EVERY, Rows, Shard, cut, shards_of
from pipeline.batch.store import ANSWERS, Store
from pipeline.clips.outcome import Outcome
from pipeline.errors import ClipError
from pipeline.files import digest

PROGRESS_EVERY_S = 5.0


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

    @property
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


AT_A_TIME = 2048
"""Clips to work on that are at hand at a time: a pool gets them together, so that its processes stay at work."""


@dataclass(frozen=True, kw_only=True)
class _Job:
    """One question: what the judged row is called, its memo key, what it is about, what to carry on."""

    clip: str
    key: str
    about: Any
    group: str
    """Jobs of one group are worked on by one call, one after the other."""
    numbers: dict[str, Any] = field(default_factory=dict)
    record: tuple[dict[str, Any], ...] = ()


@dataclass(frozen=True, kw_only=True)
class _Part:
    """The questions about one shard of the input, whose answers are recalled together while none of them changes."""

    key: str
    """Memo key of all answers together."""
    count: int
    clips: Callable[[], Sequence[str]]
    """Names of what is asked about."""
    jobs: Callable[[Sequence[str]], list[_Job]]
    """Makes the jobs, sorted by clip name. Pass their memo keys if known: computing these takes most of the time."""


@dataclass(frozen=True, kw_only=True)
class _Result:
    """What is known of the answers about one shard."""

    entries: tuple[Shard[Entry], ...]
    clips: tuple[str, ...]
    """Names of the entries."""
    judged: tuple[Shard[Judged], ...]
    unsound: tuple[tuple[str, str], ...]
    recomputed: int = 0


def run_stage(
    stage: Stage, previous: Manifest, store: Store, pool: ClipPool, log: logging.Logger, entries: Sequence[Entry] = ()
) -> Manifest:
    """The stage on all clips that `previous` hands on (or on `entries` of it), by their names within each shard."""

    def key_of(entry: Entry) -> str:
        return stage.key(entry.clip, entry.blob, entry.numbers)

    def jobs(shard: Shard[Entry], keys: Sequence[str]) -> list[_Job]:
        entries = sorted(shard.rows(), key=lambda entry: entry.clip)
        return [
            _Job(
                clip=entry.clip,
                key=key,
                about=entry,
                group=stage.group_of(entry),
                numbers=entry.numbers,
                record=entry.record,
            )
            for entry, key in zip(entries, keys or map(key_of, entries), strict=True)
        ]

    if entries or not isinstance(previous.entries, Rows):
        shards = shards_of(Entry, sorted(entries or previous.entries, key=lambda entry: entry.clip))
    else:
        shards = previous.entry_shards
    parts = [
        _Part(
            key=stage.key(SHARD, shard.digest),
            count=shard.count,
            clips=partial(_clips_of, shard),
            jobs=partial(jobs, shard),
        )
        for shard in shards
    ]
    work = partial(work_on_clips, stage.function, stage.prepare, store)
    return _gather(stage, parts, work, store, pool, log, previous.settings)


def run_files(
    stage: Stage,
    files: Iterable[tuple[str, Path, str, tuple]],
    store: Store,
    pool: ClipPool,
    log: logging.Logger,
) -> Manifest:
    """The stage on files: each `(name, path, digest of all that it is read from, further arguments)`."""
    jobs = [
        _Job(
            clip=name,
            key=stage.key(name, content),
            about=(name, path, arguments),
            group=name,
        )
        for name, path, content, arguments in sorted(files, key=lambda file: file[0])
    ]
    names = [job.clip for job in jobs]
    parts = [
        _Part(
            key=stage.key(SHARD, [job.key for job in jobs[own]]),
            count=len(jobs[own]),
            clips=partial(list, names[own]),
            jobs=partial(_all, jobs[own]),
        )
        for own in cut(names)
    ]
    work = partial(work_on_files, stage.function, store)
    return _gather(stage, parts, work, store, store.pool_of_files(pool), log, {})


def _gather(
    stage: Stage,
    parts: list[_Part],
    work: Callable[[list[Any]], list[dict[str, Any]]],
    store: Store,
    pool: ClipPool,
    log: logging.Logger,
    settings: dict[str, Any],
) -> Manifest:
    """The manifest of all parts, those worked on by `work` whose answers the memo does not have."""
    again = clips_again()
    results = [
        None if any(clip in again for clip in part.clips()) else _recalled(part.key, stage, store) for part in parts
    ]
    todo: dict[int, set[str]] = {}
    keys: dict[int, list[str]] = {}
    for place, part in enumerate(parts):
        if results[place] is None:
            jobs = part.jobs(())
            answers = {job.key: None if job.clip in again else store.recall(job.key, stage.asker) for job in jobs}
            unknown = {key for key, answer in answers.items() if answer is None}
            if unknown:
                todo[place], keys[place] = unknown, [job.key for job in jobs]
            else:
                results[place] = _result(stage, part.key, jobs, answers, 0, store)
    count, of = sum(part.count for part in parts), sum(map(len, todo.values()))
    log.info("%s: %d clips, %d known, %d to work on", stage.name, count, count - of, of)
    if of and (where := pool.where()):
        log.info("%s: %s", stage.name, where)
    done, last = 0, time.monotonic()
    started = last
    for places in _batches(todo):
        jobs_of = {place: parts[place].jobs(keys[place]) for place in places}
        asked = [job for place in places for job in jobs_of[place] if job.key in todo[place]]
        worked: dict[str, dict[str, Any]] = {}
        for job, answer in _worked_on(asked, work, pool, store):
            worked[job.key] = answer
            done += 1
            if not answer["failed"]:
                store.remember(job.key, answer, stage.asker)
            if time.monotonic() - last > PROGRESS_EVERY_S:
                last = time.monotonic()
                log.info("%s", progress(stage.name, done, of, last - started))
        for place in places:
            jobs = jobs_of[place]
            answers = {job.key: worked.get(job.key) or store.recall(job.key, stage.asker) for job in jobs}
            results[place] = _result(stage, parts[place].key, jobs, answers, len(todo[place]), store)
    found = [result for result in results if result is not None]
    _refuse_double_names(stage.name, (clip for result in found for clip in result.clips))
    own = {stage.settings_digest: {"stage": stage.name, **stage.settings, **stage.depends}}
    return Manifest(
        stage=stage.name,
        entries=Rows([shard for result in found for shard in result.entries]),
        judged=Rows([shard for result in found for shard in result.judged]),
        settings={**settings, **own},
        recomputed=sum(result.recomputed for result in found),
        unsound=tuple(each for result in found for each in result.unsound),
    )


WHOLE = 2 * CUT_EVERY
"""Rows that are made of one shard are one again up to this number."""

SHARD = "shard"
"""What a question is about that is one for all clips of a shard."""


def _recalled(key: str, stage: Stage, store: Store) -> _Result | None:
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
    return _Result(entries=entries, clips=tuple(clips), judged=judged, unsound=unsound)


def _all(jobs: list[_Job], _: Sequence[str]) -> list[_Job]:
    return jobs


def _clips_of(shard: Shard[Entry]) -> list[str]:
    return shard.columns(["clip"])["clip"]


def _batches(todo: Mapping[int, set[str]]) -> Iterator[list[int]]:
    """The places of parts that are worked on, as many at a time as have `AT_A_TIME` clips to work on together."""
    batch, size = [], 0
    for place, keys in todo.items():
        batch.append(place)
        size += len(keys)
        if size >= AT_A_TIME:
            yield batch
            batch, size = [], 0
    if batch:
        yield batch


def _result(
    stage: Stage,
    key: str,
    jobs: list[_Job],
    answers: Mapping[str, dict[str, Any] | None],
    recomputed: int,
    store: Store,
) -> _Result:
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
    result = _Result(
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


def progress(stage: str, done: int, of: int, seconds: float) -> str:
    """A line about a stage at work: clips done, percent, seconds so far and about how many are left."""
    left_s = seconds / done * (of - done)
    return f"{stage}: {done} of {of} clips ({100 * done // of} %), {seconds:.0f} s, about {left_s:.0f} s left"


def _worked_on(
    jobs: list[_Job], work: Callable[[list[Any]], list[dict[str, Any]]], pool: ClipPool, store: Store
) -> Iterator[tuple[_Job, dict[str, Any]]]:
    """Each job with its answer, as they come; a group of jobs is one call."""
    groups: dict[str, list[_Job]] = {}
    for job in jobs:
        groups.setdefault(job.group, []).append(job)
    calls = [([job.about for job in group],) for group in groups.values()]
    found = pool.map(work, calls, shared=store.shared_folders, on_lost=_Lost)
    for group, answers in zip(groups.values(), found, strict=True):
        if isinstance(answers, _Lost):
            answers = [rejection("failed", f"clip '{job.clip}': {answers.why}", None, failed=True) for job in group]
        yield from zip(group, answers, strict=True)


@dataclass(frozen=True)
class _Lost:
    """A group of jobs that worker processes died of."""

    why: str


def _entries(stage: Stage, job: _Job, answer: dict[str, Any]) -> list[Entry]:
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


def _refuse_double_names(stage: str, clips: Iterable[str]) -> None:
    seen: set[str] = set()
    for clip in clips:
        if clip in seen:
            raise ClipError(clip, "double_name", f"two clips of this name left {stage}; rename one of the files.")
        seen.add(clip)
