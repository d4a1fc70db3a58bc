"""The table of the gallery: one row for each clip that ended somewhere in the graph, in the database or rejected.

    motion_catalog -> selected -> repaired -> retargeted -> variants -> references -> rollouts -> feasible_motions

A clip that a stage rejected ends there; a clip that KP5 evaluated ends there, accepted or not. A window that KP1 did
not select is a row of its own.
"""

import gc
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from pipeline.batch import Entry, Judged, Manifest, Store
from pipeline.errors import PipelineError
from pipeline.project import DEFAULT_ROBOT

HUMAN_STAGES = ("motion_catalog", "selected_motions", "repaired_motions")
REFERENCES, ROLLOUTS, LAST = "reference_motions", "augmented_motions", "feasible_motions"
ROBOT_STAGES = ("retargeted_motions", "motion_variants", REFERENCES, ROLLOUTS, LAST)
STAGES = (*HUMAN_STAGES, *ROBOT_STAGES)
"""Assets in the order of the graph."""

DATABASE = "expert_db"
"""The asset that is made of the last stage."""

ACCEPTED, PARTLY, REJECTED, WAITING = "accepted", "partly", "rejected", "waiting"
VERDICTS = (ACCEPTED, PARTLY, REJECTED, WAITING)
"""`waiting`: the next stage was never materialized."""


class NoClipError(PipelineError):
    """A name that no current clip has."""

    def __init__(self, clip: str):
        problem = f"there is no clip '{clip}' now; it may have left the database." if clip else "no clip is named."
        super().__init__(problem)


@dataclass(frozen=True, kw_only=True)
class ClipRow:
    """A clip, where it ended, and its numbers."""

    clip: str
    stage: str
    """The stage that rejected it, or the last one that took it in."""
    verdict: str
    """One of `VERDICTS`."""
    numbers: Mapping[str, Any] = field(default_factory=dict)
    reasons: tuple[Mapping[str, Any], ...] = ()
    """Of the stage it ended at."""
    pieces: tuple[str, ...] = ()
    """Clips of the database that were made from it."""


@dataclass(frozen=True, kw_only=True)
class ClipTable:
    """All rows, and the manifests they were read from."""

    rows: tuple[ClipRow, ...]
    """In order of their names."""
    manifests: Mapping[str, Manifest]
    """Stage -> its current manifest; stages that were never materialized are missing."""

    def row(self, clip: str) -> ClipRow | None:
        """The row of a clip, or of the clip that it is a piece of."""
        return self._by_name.get(clip)

    @cached_property
    def _by_name(self) -> dict[str, ClipRow]:
        return {piece: row for row in self.rows for piece in row.pieces} | {row.clip: row for row in self.rows}


_WINDOW = re.compile(r"(?P<window>(?P<recording>.*)@\d+-\d+)(?:\+\d+)*(?:~.*)?", re.DOTALL)


def made_from(clip: str) -> tuple[str, str]:
    """The window and the recording that a clip was made from, by its name; both are the clip where it has no window.

    The names are those of KP1: a repaired piece (`…+1`) is of the window that was selected. A file's own name may
    contain the marks `@`, `+` and `~`.
    """
    match = _WINDOW.fullmatch(clip)
    return (match["window"], match["recording"]) if match else (clip, clip)


def asset_of(stage: str, robot: str) -> str:
    """Key of a stage's asset, with slashes."""
    return stage if stage in HUMAN_STAGES or robot == DEFAULT_ROBOT else f"{robot}/{stage}"


def read_table(store: Store, robot: str) -> ClipTable:
    """The table of a robot's current manifests. Raises FileError for a manifest that can't be read."""
    with _no_collections():
        manifests = {
            stage: store.load(asset_of(stage, robot)).at_hand()
            for stage in STAGES
            if store.manifest_path(asset_of(stage, robot)).is_file()
        }
        rows = {row.clip: row for row in _rows(manifests)}
    return ClipTable(rows=tuple(rows[name] for name in sorted(rows)), manifests=manifests)


@contextmanager
def _no_collections() -> Iterator[None]:
    """No garbage collection meanwhile: it would go through the millions of values again and again while they are read,
    and none of them is garbage."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


def _rows(manifests: Mapping[str, Manifest]) -> Iterator[ClipRow]:
    present = [stage for stage in STAGES if stage in manifests]
    for stage in present:
        inputs = _inputs(manifests, stage)
        entries = {entry.clip: entry for entry in manifests[stage].entries}
        for judged in manifests[stage].judged:
            taken_in = inputs.get(judged.clip)
            if stage == "selected_motions":
                yield from _windows_not_taken(judged, taken_in)
            elif stage == LAST or not judged.pieces:
                yield _row(stage, judged, taken_in, [entries[name] for name in judged.pieces if name in entries])
    if present and present[-1] != LAST:
        numbers = manifests[present[-1]].entries
        yield from (ClipRow(clip=e.clip, stage=present[-1], verdict=WAITING, numbers=e.numbers) for e in numbers)


def _inputs(manifests: Mapping[str, Manifest], stage: str) -> dict[str, Entry]:
    """The clips that a stage took in, by name. KP5 takes rollouts, references, or both."""
    before = STAGES[: STAGES.index(stage)]
    above = (REFERENCES, ROLLOUTS) if stage == LAST else before[-1:]
    return {entry.clip: entry for name in above if name in manifests for entry in manifests[name].entries}


def _row(stage: str, judged: Judged, taken_in: Entry | None, pieces: list[Entry]) -> ClipRow:
    numbers = {**(taken_in.numbers if taken_in else {}), **judged.numbers}
    if [piece.clip for piece in pieces] == [judged.clip]:  # a part of it has figures of its own
        numbers |= pieces[0].numbers
    if pieces:
        numbers["weight"] = sum(float(piece.numbers.get("weight") or 0.0) for piece in pieces)
    return ClipRow(
        clip=judged.clip,
        stage=stage,
        verdict=judged.fate,
        numbers=numbers,
        reasons=judged.reasons,
        pieces=judged.pieces,
    )


def _windows_not_taken(judged: Judged, recording: Entry | None) -> Iterator[ClipRow]:
    """Rows of the windows of a recording that KP1 did not select; of the recording, if it has no window at all."""
    numbers = recording.numbers if recording else {}
    window = re.compile(rf"{re.escape(judged.clip)}@(\d+)-(\d+)(?=: )")
    found = False
    for reason in judged.reasons:
        match = window.match(str(reason["text"])) if reason["code"] == "not_taken" else None
        if match is None:
            continue
        found = True
        start, stop = int(match[1]), int(match[2]) + 1
        fps = float(numbers.get("fps") or 0.0)
        own = {"start_frame": start, "stop_frame": stop, "seconds": (stop - start) / fps if fps else None}
        yield ClipRow(
            clip=match[0],
            stage="selected_motions",
            verdict=REJECTED,
            numbers={**numbers, **own},
            reasons=({**reason, "text": str(reason["text"])[len(match[0]) + 2 :]},),
        )
    if not judged.pieces and not found:
        yield _row("selected_motions", judged, recording, [])
