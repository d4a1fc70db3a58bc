"""Everything the page of one clip shows besides its motion: verdict, reasons, criteria, lineage, weights.

`proposals`: proposed changes with their evidence, and the answers to them.
"""

from typing import Any

import pandas as pd

from pipeline.batch import Manifest
from pipeline.curation_page.clip_table import LAST, STAGES, ClipRow, ClipTable, NoClipError, asset_of, made_from
from pipeline.errors import FileError
from pipeline.feedback.approve import FeedbackFiles
from pipeline.feedback.change import SECTIONS, Change, place_of, proposal_digest
from pipeline.feedback.trust import is_demonstration
from pipeline.files.csv_json import without_nan
from pipeline.selection.curation import Decision

CRITERIA = (
    *("group", "criterion", "number", "threshold", "sense", "unit"),
    *("verdict", "margin", "message", "source", "why"),
)
"""Columns of the table of criteria that the page shows."""

MOST_MADE = 500
"""Clips that are listed of those that were made from another one."""


def clip_details(
    table: ClipTable, criteria: pd.DataFrame | None, decisions: tuple[Decision, ...], robot: str, clip: str
) -> dict[str, Any]:
    """The details of a clip as JSON types; of one that passed all its stages, the clips that were made from it.

    Raises NoClipError for a clip that neither is in the table nor has such clips.
    """
    row = table.row(clip)
    if row is None:
        return _passed(table, decisions, clip)
    return {
        "clip": row.clip,
        "stage": row.stage,
        "verdict": row.verdict,
        "numbers": {name: value for name, value in sorted(row.numbers.items()) if not str(value).startswith("[[")},
        "reasons": [dict(reason) for reason in row.reasons],
        "pieces": _pieces(table.manifests.get(row.stage), row),
        "criteria": _criteria(criteria, row),
        "lineage": _lineage(table, row),
        "names": _names(row),
        "assets": {stage: asset_of(stage, robot) for stage in STAGES},
        "starts_s": _starts_s(row),
        "decisions": [vars(each) for each in decisions if each.clip in {*_names(row), *row.pieces}],
    }


def _passed(table: ClipTable, decisions: tuple[Decision, ...], clip: str) -> dict[str, Any]:
    """The clips of the table that were made from a recording, window or variant. Raises NoClipError."""
    made = [row.clip for row in table.rows if clip in ancestors(row)]
    if not made:
        raise NoClipError(clip)
    names = list(dict.fromkeys(made_from(clip)))
    own = [vars(each) for each in decisions if each.clip in {clip, *names}]
    return {"clip": clip, "made": made[:MOST_MADE], "count": len(made), "names": names, "decisions": own}


def _names(row: ClipRow) -> list[str]:
    """What a decision on this clip may name: itself, the window and the recording that it was made from."""
    return list(dict.fromkeys((row.clip, *made_from(row.clip))))


def _starts_s(row: ClipRow) -> float:
    """Time of the clip's first frame in the times of its reasons [s]: KP2 states times of the whole recording."""
    fps = float(row.numbers.get("fps") or 0.0)
    start = row.numbers.get("start_frame")
    return float(start) / fps if row.stage == "repaired_motions" and start and fps else 0.0


def _pieces(manifest: Manifest | None, row: ClipRow) -> list[dict[str, Any]]:
    """Each clip of the database that was made from this one: its stretch [s] and weight."""
    if manifest is None or row.stage != LAST:
        return []
    wanted = set(row.pieces)
    before_s = float(row.numbers.get("stretch_start_s") or 0.0)  # the clip may be a stretch itself
    found = []
    for entry in manifest.entries:
        if entry.clip in wanted:
            numbers = entry.numbers
            start_s = float(numbers.get("stretch_start_s") or 0.0) - before_s
            found.append(
                {
                    "clip": entry.clip,
                    "start_s": round(start_s, 3),
                    "stop_s": round(start_s + float(numbers["seconds"]), 3),
                    "weight": numbers.get("weight"),
                    "family": numbers.get("family"),
                }
            )
    return found


def _criteria(criteria: pd.DataFrame | None, row: ClipRow) -> list[dict[str, Any]]:
    """Rows of the table of criteria, stretch by stretch; what is no number is None."""
    if criteria is None or row.stage != LAST:
        return []
    own = criteria.loc[criteria["clip"] == row.clip, ["start_s", "stop_s", "piece", *CRITERIA]]
    return without_nan(own.to_dict("records"))


def _lineage(table: ClipTable, row: ClipRow) -> list[dict[str, Any]]:
    """What each stage did with the clip and those that it was made from, in the order of the graph."""
    made_from = ancestors(row)
    steps = []
    for stage in STAGES:
        manifest = table.manifests.get(stage)
        judged = manifest and max(
            (each for each in manifest.judged if each.clip in made_from), key=lambda each: len(each.clip), default=None
        )
        if not judged:
            continue
        reasons = [dict(reason) for reason in judged.reasons]
        if stage == "selected_motions":
            reasons = [
                each for each in reasons if each["code"] != "not_taken" or str(each["text"]).startswith(row.clip)
            ]
        steps.append({"stage": stage, "clip": judged.clip, "fate": judged.fate, "reasons": reasons})
    return steps


def ancestors(row: ClipRow) -> set[str]:
    """Names of the clip and of all that it was made from: every beginning of its name that ends before a mark."""
    names = {row.clip, *(row.clip[:place] for place, letter in enumerate(row.clip) if letter in "@+~")}
    parents = {str(row.numbers[name]) for name in ("parent", "reference") if row.numbers.get(name)}
    return names | parents


def proposals(files: FeedbackFiles) -> dict[str, Any]:
    """The pending proposal, what is approved and what can't be used, as JSON types."""
    try:
        changes = files.proposed()
        missing = ""
    except FileError as error:
        changes, missing = (), str(error)
    approvals, declined = files.approvals(), files.declined_changes()
    places = {place_of(change) for change in changes}
    return {
        "proposal": proposal_digest(changes),
        "missing": missing,
        "sections": SECTIONS,
        "changes": [_change(each, _answer(each, approvals.changes, declined)) for each in changes],
        "lingering": [_change(each, "approved") for each in approvals.changes if place_of(each) not in places],
        "approved": [
            {"section": entry.section, "by": entry.by, "proposal": entry.proposal, "changes": len(entry.changes)}
            for entry in approvals.entries
        ],
        "faults": sorted({str(fault) for fault in approvals.faults.values()}),
    }


def _answer(change: Change, approved: tuple[Change, ...], declined: tuple[Change, ...]) -> str:
    return "approved" if change in approved else "declined" if change in declined else "pending"


def _change(change: Change, answer: str) -> dict[str, Any]:
    return {
        **{name: getattr(change, name) for name in ("section", "robot", "what", "before", "value", "bound")},
        "counted": change.counted(),
        "demonstration": is_demonstration(change),
        "answer": answer,
        "evidence": [{**vars(each), "text": each.said} for each in change.witnesses],
    }
