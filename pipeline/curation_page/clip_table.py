"""Table of the gallery: one row for each clip at its last stage, accepted or rejected.

    motion_catalog -> selected -> repaired -> retargeted -> variants -> references -> rollouts -> feasible_motions

The last stage of a clip is the one that rejected it, or KP5 (`feasible_motions`). A window that KP1 did not select has
a row of its own.
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
"""Stages in the order of the graph."""

DATABASE = "expert_db"
"""The asset of the database, downstream of the last stage."""

ACCEPTED, PARTLY, REJECTED, WAITING = "accepted", "partly", "rejected", "waiting"
VERDICTS = (ACCEPTED, PARTLY, REJECTED, WAITING)
"""Verdicts of a row; `waiting`: the next stage was never materialized."""


class NoClipError(PipelineError):
    """There is no current clip of this name."""

    def __init__(self, clip: str):
        problem = (
            f"there is no clip '{clip}'; it may have been removed from the database." if clip else "no clip is named."
        )
        super().__init__(problem)


@dataclass(frozen=True, kw_only=True)
class ClipRow:
    """A clip with its last stage, verdict and numbers."""

    clip: str
    stage: str
    """The stage that rejected it, or the last stage with it as input."""
    verdict: str
    """One of `VERDICTS`."""
    numbers: Mapping[str, Any] = field(default_factory=dict)
    reasons: tuple[Mapping[str, Any], ...] = ()
    """Reasons of this stage."""
    pieces: tuple[str, ...] = ()
    """Clips of the database that are parts of it."""


@dataclass(frozen=True, kw_only=True)
class ClipTable:
    """All rows, and the manifests that they were read from."""

    rows: tuple[ClipRow, ...]
    """Rows, sorted by name."""
    manifests: Mapping[str, Manifest]
    """Stage -> its current manifest; stages that were never materialized are missing."""

    def row(self, clip: str) -> ClipRow | None:
        """The row of a clip, or of the clip that it is a part of; None without one."""
        return self._by_name.get(clip)

    @cached_property
    def _by_name(self) -> dict[str, ClipRow]:
        return {piece: row for row in self.rows for piece in row.pieces} | {row.clip: row for row in self.rows}


_WINDOW = re.compile(r"(?P<window>(?P<recording>.*)@\d+-\d+)(?:\+\d+)*(?:~.*)?", re.DOTALL)


def made_from(clip: str) -> tuple[str, str]:
    """Names of the window and the recording of a clip, parsed from its name; without a window, both are the clip.

    For a repaired piece (`…+1`), it is the window that KP1 selected. File names may contain `@`, `+` and `~`.
    """
    match = _WINDOW.fullmatch(clip)
    return (match["window"], match["recording"]) if match else (clip, clip)


def asset_of(stage: str, robot: str) -> str:
    """Key of a stage's asset, separated by slashes."""
    return stage if stage in HUMAN_STAGES or robot == DEFAULT_ROBOT else f"{robot}/{stage}"


def read_table(store: Store, robot: str) -> ClipTable:
    """Read the table from a robot's current manifests. Raises FileError for an unreadable manifest."""
    with _garbage_collection_paused():
        manifests = {
            stage: store.load(asset_of(stage, robot)).at_hand()
            for stage in STAGES
            if store.manifest_path(asset_of(stage, robot)).is_file()
        }
        rows = {row.clip: row for row in _rows(manifests)}
    return ClipTable(rows=tuple(rows[name] for name in sorted(rows)), manifests=manifests)


@contextmanager
def _garbage_collection_paused() -> Iterator[None]:
    """Pause garbage collection while millions of values are read: repeated scans of them would only take time."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def _rows(manifests: Mapping[str, Manifest]) -> Iterator[ClipRow]:
    present = [stage for stage in STAGES if stage in manifests]
    for stage in present:
        inputs = _inputs(manifests, stage)
        entries = {entry.clip: entry for entry in manifests[stage].entries}
        for judged in manifests[stage].judged:
            source = inputs.get(judged.clip)
            if stage == "selected_motions":
                yield from _unselected_windows(judged, source)
            elif stage == LAST or not judged.pieces:
                yield _row(stage, judged, source, [entries[name] for name in judged.pieces if name in entries])
    if present and present[-1] != LAST:
        numbers = manifests[present[-1]].entries
        yield from (ClipRow(clip=e.clip, stage=present[-1], verdict=WAITING, numbers=e.numbers) for e in numbers)


def _inputs(manifests: Mapping[str, Manifest], stage: str) -> dict[str, Entry]:
    """Name -> input clip of a stage. The inputs of KP5 are rollouts, references, or both."""
    before = STAGES[: STAGES.index(stage)]
    above = (REFERENCES, ROLLOUTS) if stage == LAST else before[-1:]
    return {entry.clip: entry for name in above if name in manifests for entry in manifests[name].entries}


def _row(stage: str, judged: Judged, source: Entry | None, pieces: list[Entry]) -> ClipRow:
    numbers = {**(source.numbers if source else {}), **judged.numbers}
    if [piece.clip for piece in pieces] == [judged.clip]:  # a shorter part has other figures
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


def _unselected_windows(judged: Judged, recording: Entry | None) -> Iterator[ClipRow]:
    """Yield rows of the windows that KP1 did not select; of the recording itself if it has no windows."""
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
