"""Data of the page of one clip, without its motion: verdict, reasons, criteria, lineage, weights.

`proposals` returns the data of the proposals page: proposed changes, their evidence, and the answers to them.
"""

from typing import Any

import pandas as pd

from pipeline.batch import Manifest
from pipeline.curation_page.clip_table import LAST, STAGES, ClipRow, ClipTable, NoClipError, asset_of, made_from
from pipeline.errors import FileError
from pipeline.feedback.approve import FeedbackFiles
from pipeline.feedback.change import SECTIONS, Change, change_key, proposal_digest
from pipeline.feedback.trust import is_demonstration
from pipeline.files.csv_json import without_nan
from pipeline.selection.curation import Decision

CRITERIA = (
    *("group", "criterion", "number", "threshold", "sense", "unit"),
    *("verdict", "margin", "message", "source", "why"),
)
"""Columns of the criteria table on the page."""

MAX_DERIVED = 500
"""Maximum number of derived clips on the page of a recording, window or variant."""


def clip_details(
    table: ClipTable, criteria: pd.DataFrame | None, decisions: tuple[Decision, ...], robot: str, clip: str
) -> dict[str, Any]:
    """Details of a clip as JSON types. For a recording, window or variant without a row, the clips derived from it.

    Raises NoClipError if the clip is not in the table and has no derived clips.

    Args:
        table: table of all clips
        criteria: KP5's criteria table; None without one
        decisions: decisions on clips
        robot: name of the robot
        clip: name of the clip
    """
    row = table.row(clip)
    if row is None:
        return _derived(table, decisions, clip)
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


def _derived(table: ClipTable, decisions: tuple[Decision, ...], clip: str) -> dict[str, Any]:
    """Clips of the table that are derived from a recording, window or variant. Raises NoClipError."""
    made = [row.clip for row in table.rows if clip in ancestors(row)]
    if not made:
        raise NoClipError(clip)
    names = list(dict.fromkeys(made_from(clip)))
    own = [vars(each) for each in decisions if each.clip in {clip, *names}]
    return {"clip": clip, "made": made[:MAX_DERIVED], "count": len(made), "names": names, "decisions": own}


def _names(row: ClipRow) -> list[str]:
    """Names that a decision on this clip can refer to: the clip, its window and its recording."""
    return list(dict.fromkeys((row.clip, *made_from(row.clip))))


def _starts_s(row: ClipRow) -> float:
    """Time of the clip's first frame on the time axis of its reasons [s]; KP2's reasons use the recording's time."""
    fps = float(row.numbers.get("fps") or 0.0)
    start = row.numbers.get("start_frame")
    return float(start) / fps if row.stage == "repaired_motions" and start and fps else 0.0


def _pieces(manifest: Manifest | None, row: ClipRow) -> list[dict[str, Any]]:
    """Clips of the database that are parts of this clip: start and stop [s], weight, family."""
    if manifest is None or row.stage != LAST:
        return []
    pieces = set(row.pieces)
    before_s = float(row.numbers.get("stretch_start_s") or 0.0)  # the clip itself may be a part of a longer one
    found = []
    for entry in manifest.entries:
        if entry.clip in pieces:
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
    """Rows of the criteria table for a clip, in order of time; NaN becomes None."""
    if criteria is None or row.stage != LAST:
        return []
    own = criteria.loc[criteria["clip"] == row.clip, ["start_s", "stop_s", "piece", *CRITERIA]]
    return without_nan(own.to_dict("records"))


def _lineage(table: ClipTable, row: ClipRow) -> list[dict[str, Any]]:
    """Result of each stage for the clip or its ancestor, in the order of the graph."""
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
    """Names of the clip and its ancestors: the prefixes of its name that end before `@`, `+` or `~`, its `parent` and
    its `reference`."""
    names = {row.clip, *(row.clip[:place] for place, letter in enumerate(row.clip) if letter in "@+~")}
    parents = {str(row.numbers[name]) for name in ("parent", "reference") if row.numbers.get(name)}
    return names | parents


def proposals(files: FeedbackFiles) -> dict[str, Any]:
    """The pending proposal, the approved changes and their faults, as JSON types."""
    try:
        changes = files.proposed()
        missing = ""
    except FileError as error:
        changes, missing = (), str(error)
    approvals, declined = files.approvals(), files.declined_changes()
    proposed = {change_key(change) for change in changes}
    return {
        "proposal": proposal_digest(changes),
        "missing": missing,
        "sections": SECTIONS,
        "changes": [_change(each, _answer(each, approvals.changes, declined)) for each in changes],
        "lingering": [_change(each, "approved") for each in approvals.changes if change_key(each) not in proposed],
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
