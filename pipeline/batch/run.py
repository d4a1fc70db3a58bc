"""Run a stage over clips: ask the memo, work on the rest in parallel, gather a manifest.

The memo's key is everything an answer depends on: stage code, settings, robot, the clip's bytes and
the numbers of earlier stages. So the same question is never worked on twice, in any run.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from pipeline.batch.again import clips_again
from pipeline.batch.manifest import Entry, Judged, Manifest
from pipeline.batch.pool import ClipPool
from pipeline.batch.store import Store
from pipeline.clips.codec import faults_of
from pipeline.clips.outcome import Clip, Outcome, Piece
from pipeline.errors import ClipError, FileError
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


def run_stage(
    stage: Stage, previous: Manifest, store: Store, pool: ClipPool, log: logging.Logger, entries: Sequence[Entry] = ()
) -> Manifest:
    """The stage on all clips that `previous` hands on (or on `entries` of it), in order of their names."""
    jobs = [
        _Job(
            clip=entry.clip,
            key=stage.key(entry.clip, entry.blob, entry.numbers),
            about=entry,
            group=stage.group_of(entry),
            numbers=entry.numbers,
            record=entry.record,
        )
        for entry in sorted(entries or previous.entries, key=lambda entry: entry.clip)
    ]
    work = partial(_work_on_clips, stage.function, stage.prepare, store)
    return _gather(stage, jobs, work, store, pool, log, previous.settings)


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
    work = partial(_work_on_files, stage.function, store)
    return _gather(stage, jobs, work, store, store.pool_of_files(pool), log, {})


def _gather(
    stage: Stage,
    jobs: list[_Job],
    work: Callable[[list[Any]], list[dict[str, Any]]],
    store: Store,
    pool: ClipPool,
    log: logging.Logger,
    settings: dict[str, Any],
) -> Manifest:
    """The manifest of all jobs, those worked on by `work` whose answers the memo does not have."""
    again = clips_again()
    answers = {job.key: None if job.clip in again else store.recall(job.key, stage.asker) for job in jobs}
    todo = [job for job in jobs if answers[job.key] is None]
    log.info("%s: %d clips, %d known, %d to work on", stage.name, len(jobs), len(jobs) - len(todo), len(todo))
    if todo and (where := pool.where()):
        log.info("%s: %s", stage.name, where)
    last = started = time.monotonic()
    for count, (job, answer) in enumerate(_worked_on(todo, work, pool, store), 1):
        answers[job.key] = answer
        if not answer["failed"]:
            store.remember(job.key, answer, stage.asker)
        if time.monotonic() - last > PROGRESS_EVERY_S:
            last = time.monotonic()
            log.info("%s", progress(stage.name, count, len(todo), last - started))
    entries: list[Entry] = []
    judged: list[Judged] = []
    unsound: list[tuple[str, str]] = []
    for job in jobs:
        answer = answers[job.key]
        assert answer is not None
        entries += _entries(stage, job, answer)
        unsound += [(clip, fault) for clip, fault in answer["unsound"]]
        names = tuple(piece["clip"] for piece in answer["pieces"])
        judged.append(Judged(clip=job.clip, pieces=names, reasons=tuple(answer["reasons"]), numbers=answer["numbers"]))
    _refuse_double_names(stage.name, entries)
    settings = {**settings, stage.settings_digest: {"stage": stage.name, **stage.settings, **stage.depends}}
    return Manifest(
        stage=stage.name,
        entries=tuple(entries),
        judged=tuple(judged),
        settings=settings,
        recomputed=len(todo),
        unsound=tuple(unsound),
    )


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
            answers = [_rejection("failed", f"clip '{job.clip}': {answers.why}", None, failed=True) for job in group]
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


def _refuse_double_names(stage: str, entries: list[Entry]) -> None:
    seen: set[str] = set()
    for entry in entries:
        if entry.clip in seen:
            raise ClipError(entry.clip, "double_name", f"two clips of this name left {stage}; rename one of the files.")
        seen.add(entry.clip)


def _work_on_clips(
    function: Callable[..., Outcome], prepare: Callable[..., Any] | None, store: Store, entries: list[Entry]
) -> list[dict[str, Any]]:
    """Answers for clips of one motion, prepared when the first needs it; where that fails, each fails by itself."""
    prepared: list[Any] = []

    def work(clip: Clip, numbers: dict[str, Any]) -> Outcome:
        if prepare is None:
            return function(clip, numbers)
        if not prepared:
            prepared.append(prepare(clip))
        return function(clip, numbers, prepared=prepared[0])

    answers = []
    for entry in entries:
        clip = store.get_clip(entry.blob, entry.clip)
        seconds_in = entry.numbers.get("seconds", clip.duration_s)
        answers.append(_answer(partial(work, clip, entry.numbers), store, entry.clip, seconds_in))
    return answers


def _work_on_files(
    function: Callable[..., Outcome], store: Store, files: list[tuple[str, Path, tuple]]
) -> list[dict[str, Any]]:
    """Answers for files; one that this process does not see is a failure, which the next run tries again."""
    answers = []
    for name, path, arguments in files:
        if path.exists():
            answers.append(_answer(partial(function, path, name, *arguments), store, name, None))
        else:
            text = f"{path}: it is not there for the process that reads it; mount its folder there under this path."
            answers.append(_rejection("failed", text, None, failed=True))
    return answers


def _answer(work: Callable[[], Outcome], store: Store, name: str, seconds_in: float | None) -> dict[str, Any]:
    """The outcome as JSON types, its clips stored. What goes wrong with a clip becomes its rejection."""
    failed = False
    try:
        outcome = work()
    except (ClipError, FileError) as error:
        code = error.code if isinstance(error, ClipError) else "unreadable"
        return _rejection(code, str(error), seconds_in, failed)
    except Exception as error:  # a fault of ours must not stop the other clips; it is tried again in the next run
        text = f"clip '{name}': the stage failed with {type(error).__name__}: {error}"
        return _rejection("failed", text, seconds_in, failed=True)
    pieces = [
        {"clip": piece.clip.name, "blob": store.put_clip(piece.clip), "numbers": _plain(piece.numbers)}
        for piece in outcome.pieces
    ]
    seconds_out = sum(_seconds(piece) for piece in outcome.pieces)
    numbers = {"seconds_in": seconds_in, "seconds_out": seconds_out, **_plain(outcome.numbers)}
    if numbers["seconds_in"] is None:
        numbers["seconds_in"] = numbers.get("seconds", numbers["seconds_out"])
    return {
        "failed": failed,
        "pieces": pieces,
        "unsound": [(piece.clip.name, fault) for piece in outcome.pieces for fault in faults_of(piece.clip)],
        "reasons": [_plain(reason.to_dict()) for reason in outcome.reasons],
        "numbers": numbers,
    }


def _seconds(piece: Piece) -> float:
    """Length of a piece [s]; a window of a whole clip says its own."""
    return float(piece.numbers.get("seconds") or piece.clip.duration_s)


def _rejection(code: str, text: str, seconds_in: float | None, failed: bool) -> dict[str, Any]:
    reason = {"code": code, "text": text, "effect": "rejected"}
    numbers = {"seconds_in": seconds_in or 0.0, "seconds_out": 0.0}
    return {"failed": failed, "pieces": [], "unsound": [], "reasons": [reason], "numbers": numbers}


def _plain(numbers: Any) -> dict[str, Any]:
    """JSON types: numpy scalars become Python's, a number that is not finite becomes None."""
    plain = {}
    for name, value in numbers.items():
        value = value.item() if hasattr(value, "item") else value
        plain[name] = None if isinstance(value, float) and not math.isfinite(value) else value
    return plain
