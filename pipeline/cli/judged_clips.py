"""KP5's verdicts on clips that the graph has made: all criteria, found by name in the table beside its manifest."""

from __future__ import annotations

import difflib
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pipeline.cli.project import Project
from pipeline.cli.stored_clips import BARE_ROBOT
from pipeline.cli.text_table import text_table
from pipeline.errors import FileError, PipelineError
from pipeline.feasibility import criteria_table
from pipeline.feasibility.criteria_table import BROKEN, NOT_APPLICABLE
from pipeline.files.json_file import read_json

Row = dict[str, Any]
"""A row of the table; its columns are `criteria_table.COLUMNS`."""

_MARKS = "@+~/"
"""What the names of clips made from a clip go on with."""


def judged(project: Project, name: str, robot: str) -> list[Row]:
    """Rows of the table of criteria: of the clip of that name, of the one that went on under it, or of all clips made
    from it (`name@…`, `name~…`, `name/…`). What is no number is None.

    Raises PipelineError with the names that come near, FileError where nothing was judged yet.
    """
    rows = _rows(project, robot)
    for column in ("clip", "piece"):
        own = [row for row in rows if row[column] == name]
        if own:
            return own
    stem = name.rstrip(_MARKS)
    made = [row for row in rows if any(row["clip"].startswith(stem + mark) for mark in _MARKS)]
    if not made:
        names = sorted({row[column] for row in rows for column in ("clip", "piece")} - {""})
        near = difflib.get_close_matches(name, names, n=5, cutoff=0.3) or names[:5]
        raise PipelineError(f"'{name}' is neither a file nor a clip that was judged; near it are: {', '.join(near)}")
    return made


def clip_of(database_file: Path) -> str:
    """Name of the clip in a file of the database. Raises FileError."""
    try:
        return str(read_json(database_file)["Clip"])
    except (KeyError, TypeError) as error:
        raise FileError(database_file, f"not a clip of an expert database ({type(error).__name__}).") from error


def as_text(rows: Sequence[Row]) -> str:
    """Every criterion of one clip, stretch by stretch; of several clips a line each."""
    if len({row["clip"] for row in rows}) > 1:
        return _overview(rows)
    stretches = itertools.groupby(rows, key=lambda row: (row["start_s"], row["stop_s"]))
    return "\n\n".join(_stretch(list(own)) for _, own in stretches)


def _rows(project: Project, robot: str) -> list[Row]:
    asset = "feasible_motions" if robot == BARE_ROBOT else f"{robot}/feasible_motions"
    manifest = project.store.manifest_path(asset)
    table = criteria_table.read(criteria_table.path_beside(manifest), manifest, asset)
    return [
        {str(name): None if value != value else value for name, value in row.items()}
        for row in table.to_dict("records")
    ]


def _stretch(own: Sequence[Row]) -> str:
    """A table of the criteria of one stretch, and what is wrong with it."""
    first = own[0]
    fate = f"goes on as '{first['piece']}'" if first["piece"] else "does not go on like this"
    head = f"{first['clip']}, {first['start_s']:.2f} to {first['stop_s']:.2f} s: {fate}"
    header = ["group", "criterion", "number", "threshold", "unit", "margin", "verdict", "source"]
    groups = [None, *(row["group"] for row in own)]
    lines = [
        ["" if row["group"] == before else row["group"], row["criterion"], *_cells(row)]
        for row, before in zip(own, groups, strict=False)
    ]
    broken = [f"  {row['criterion']}: {row['message']}" for row in own if row["verdict"] == BROKEN]
    return "\n".join([head, text_table(header, lines, indent="  "), *(["  broken", *broken] if broken else [])])


def _cells(row: Row) -> Sequence[str]:
    """Number, threshold, unit, margin, verdict, source."""
    number = "" if row["number"] is None else f"{row['number']:.3g}"
    threshold = "" if row["threshold"] is None else f"{row['sense']} {row['threshold']:.3g}"
    margin = "" if row["margin"] is None else f"{100 * row['margin']:.0f} %"
    verdict = f"{row['verdict']}: {row['message']}" if row["verdict"] == NOT_APPLICABLE else row["verdict"]
    source = f"{row['source']}: {row['why']}" if row["source"] else ""
    return number, threshold, row["unit"], margin, verdict, source


def _overview(rows: Sequence[Row]) -> str:
    """A line a clip."""
    lines = []
    for clip, group in itertools.groupby(rows, key=lambda row: row["clip"]):
        own = list(group)
        kept = {row["piece"]: row["stop_s"] - row["start_s"] for row in own if row["piece"]}
        broken = dict.fromkeys(row["criterion"] for row in own if row["verdict"] == BROKEN)
        lines.append([clip, max(row["stop_s"] for row in own), sum(kept.values(), 0.0), ", ".join(broken) or "nothing"])
    return text_table(["clip", "in [s]", "goes on [s]", "broken"], lines)
