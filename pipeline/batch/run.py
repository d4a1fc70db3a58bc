"""Run a stage over clips: look up the memo, compute the rest in parallel, assemble a manifest.

The memo's key contains everything an answer depends on: stage code, settings, robot, the clip's bytes and the numbers
of earlier stages. So no result is computed twice, in any run. The answers about all clips of an unchanged shard are
looked up together: an added clip costs only the lookup of its own shard, however many shards there are.
"""

import logging
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pipeline.batch.again import clips_again
from pipeline.batch.answer import rejection, work_on_clips, work_on_files
from pipeline.batch.manifest import Manifest
from pipeline.batch.pool import ClipPool
from pipeline.batch.rows import Entry
from pipeline.batch.shard import Rows, Shard, cut, shards_of
from pipeline.batch.shard_answers import Job, Stage, recalled, result_of
from pipeline.batch.store import Store
from pipeline.errors import ClipError

PROGRESS_EVERY_S = 5.0


AT_A_TIME = 2048
"""Clips per batch given to a pool, large enough to keep its processes busy."""


@dataclass(frozen=True, kw_only=True)
class _Part:
    """The questions about one input shard; their answers are looked up together if all are unchanged."""

    key: str
    """Memo key of the combined answers."""
    count: int
    clips: Callable[[], Sequence[str]]
    """Names of the clips."""
    jobs: Callable[[Sequence[str]], list[Job]]
    """Makes the jobs, sorted by clip name. Pass their memo keys if known: computing these takes most of the time."""


def run_stage(
    stage: Stage, previous: Manifest, store: Store, pool: ClipPool, log: logging.Logger, entries: Sequence[Entry] = ()
) -> Manifest:
    """Run the stage on all kept clips of `previous` (or on `entries` of it), sorted by name within each shard."""

    def key_of(entry: Entry) -> str:
        return stage.key(entry.clip, entry.blob, entry.numbers)

    def jobs(shard: Shard[Entry], keys: Sequence[str]) -> list[Job]:
        entries = sorted(shard.rows(), key=lambda entry: entry.clip)
        return [
            Job(
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
    """Run the stage on files: `(name, path, digest of everything that is read, further arguments)` each."""
    jobs = [
        Job(
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
    """Assemble the manifest of all parts; parts whose answers are not in the memo are computed by `work`."""
    again = clips_again()
    results = [
        None if any(clip in again for clip in part.clips()) else recalled(part.key, stage, store) for part in parts
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
                results[place] = result_of(stage, part.key, jobs, answers, 0, store)
    count, of = sum(part.count for part in parts), sum(map(len, todo.values()))
    log.info("%s: %d clips, %d known, %d to work on", stage.name, count, count - of, of)
    if of and (where := pool.where()):
        log.info("%s: %s", stage.name, where)
    done, last = 0, time.monotonic()
    started = last
    for places in _batches(todo):
        jobs_of = {place: parts[place].jobs(keys[place]) for place in places}
        asked = [(place, job) for place in places for job in jobs_of[place] if job.key in todo[place]]
        left = Counter(place for place, _ in asked)
        worked: dict[int, dict[str, dict[str, Any]]] = {place: {} for place in places}
        for place, job, answer in _worked_on(asked, work, pool, store):
            worked[place][job.key] = answer
            left[place] -= 1
            done += 1
            if not answer["failed"]:
                store.remember(job.key, answer, stage.asker)
            if not left[place]:  # meanwhile the pool computes the next part
                known, jobs = worked.pop(place), jobs_of.pop(place)
                answers = {job.key: known.get(job.key) or store.recall(job.key, stage.asker) for job in jobs}
                results[place] = result_of(stage, parts[place].key, jobs, answers, len(todo[place]), store)
            if time.monotonic() - last > PROGRESS_EVERY_S:
                last = time.monotonic()
                log.info("%s", progress(stage.name, done, of, last - started))
    found = [result for result in results if result is not None]
    assert len(found) == len(parts)
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


SHARD = "shard"
"""Kind of a question about all clips of a shard."""


def _all(jobs: list[Job], _: Sequence[str]) -> list[Job]:
    return jobs


def _clips_of(shard: Shard[Entry]) -> list[str]:
    return shard.columns(["clip"])["clip"]


def _batches(todo: Mapping[int, set[str]]) -> Iterator[list[int]]:
    """Batches of indices of parts to compute, each with about `AT_A_TIME` clips."""
    batch, size = [], 0
    for place, keys in todo.items():
        batch.append(place)
        size += len(keys)
        if size >= AT_A_TIME:
            yield batch
            batch, size = [], 0
    if batch:
        yield batch


def progress(stage: str, done: int, of: int, seconds: float) -> str:
    """Progress line of a stage: clips done, percent, elapsed and estimated remaining seconds."""
    left_s = seconds / done * (of - done)
    return f"{stage}: {done} of {of} clips ({100 * done // of} %), {seconds:.0f} s, about {left_s:.0f} s left"


def _worked_on(
    jobs: list[tuple[int, Job]], work: Callable[[list[Any]], list[dict[str, Any]]], pool: ClipPool, store: Store
) -> Iterator[tuple[int, Job, dict[str, Any]]]:
    """Yield index of the part, job and answer of each job; a group of jobs is one call."""
    groups: dict[str, list[tuple[int, Job]]] = {}
    for place, job in jobs:
        groups.setdefault(job.group, []).append((place, job))
    calls = [([job.about for _, job in group],) for group in groups.values()]
    found = pool.map(work, calls, shared=store.shared_folders, on_lost=_Lost)
    for group, answers in zip(groups.values(), found, strict=True):
        if isinstance(answers, _Lost):
            answers = [rejection("failed", f"clip '{job.clip}': {answers.why}", None, failed=True) for _, job in group]
        for (place, job), answer in zip(group, answers, strict=True):
            yield place, job, answer


@dataclass(frozen=True)
class _Lost:
    """A group of jobs that killed worker processes."""

    why: str


def _refuse_double_names(stage: str, clips: Iterable[str]) -> None:
    seen: set[str] = set()
    for clip in clips:
        if clip in seen:
            raise ClipError(clip, "double_name", f"two clips of this name left {stage}; rename one of the files.")
        seen.add(clip)
