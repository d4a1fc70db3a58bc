"""Clips that a person sends through all their stages again, and what came of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.curation_page.clip_details import ancestors
from pipeline.curation_page.clip_table import STAGES, ClipRow, ClipTable, NoClipError, asset_of
from pipeline.files import digest

UNCHANGED, CHANGED, GONE = "unchanged", "changed", "gone"
SHOWN = 20
"""Clips that an outcome names."""


@dataclass(frozen=True, kw_only=True)
class Rerun:
    """Clips that are worked on again, with their results before."""

    before: Mapping[str, str]
    """Clip -> digest of its result."""
    names: tuple[str, ...]
    """All clips that the stages work on again: these and those that they were made from."""
    assets: tuple[str, ...]
    """Assets to materialize, upstream first."""

    def outcome(self, table: ClipTable) -> dict[str, Any]:
        """How many clips have the same result in a table, and which have another one or are gone."""
        found: dict[str, list[str]] = {UNCHANGED: [], CHANGED: [], GONE: []}
        results = _results(table, self.before)
        for clip, before in self.before.items():
            after = results.get(clip)
            found[GONE if after is None else UNCHANGED if after == before else CHANGED].append(clip)
        return {
            "clips": len(self.before),
            **{kind: {"count": len(clips), "clips": clips[:SHOWN]} for kind, clips in found.items()},
        }


def rerun_of(table: ClipTable, clips: Iterable[str], robot: str, database: str) -> Rerun:
    """The rerun of some clips of the table, from the recording on. Raises NoClipError.

    Args:
        database: the asset of the robot's database, which is made last
    """
    rows = []
    for clip in dict.fromkeys(clips):
        row = table.row(clip)
        if row is None:
            raise NoClipError(clip)
        rows.append(row)
    if not rows:
        raise NoClipError("")
    made_from = {name for row in rows for name in ancestors(row)}
    known = {judged.clip for manifest in table.manifests.values() for judged in manifest.judged}
    return Rerun(
        before=_results(table, [row.clip for row in rows]),
        names=tuple(sorted(made_from & known)),
        assets=(*(asset_of(stage, robot) for stage in STAGES), database),
    )


def _results(table: ClipTable, clips: Iterable[str]) -> dict[str, str]:
    """Digest of where each clip ended, why, with which figures and motions; clips that are not there are left out."""
    rows = {clip: row for clip in clips if (row := table.row(clip)) is not None}
    pieces = {name for row in rows.values() for name in (row.clip, *row.pieces)}
    blobs: dict[str, list[str]] = {}
    for manifest in table.manifests.values():
        for entry in manifest.entries:
            if entry.clip in pieces:
                blobs.setdefault(entry.clip, []).append(entry.blob)
    return {clip: _digest(row, blobs) for clip, row in rows.items()}


def _digest(row: ClipRow, blobs: Mapping[str, list[str]]) -> str:
    figures = {name: value for name, value in row.numbers.items() if name != "weight"}  # depends on all other clips
    motions = [blobs.get(name, []) for name in (row.clip, *row.pieces)]
    return digest.of_json([row.stage, row.verdict, list(map(dict, row.reasons)), list(row.pieces), figures, motions])
