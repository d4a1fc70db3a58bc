"""Clips in the store's manifests by name, and their criteria by KP5."""

import dataclasses
import difflib
import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.cli.text_table import text_table
from pipeline.clips.robot_clip import RobotClip
from pipeline.curation_page.clip_table import DATABASE, LAST, ClipRow, asset_of, read_table
from pipeline.curation_page.motion_sources import MotionSources
from pipeline.errors import FileError, PipelineError
from pipeline.feasibility import criteria_table
from pipeline.feasibility.criteria_table import BROKEN, NOT_APPLICABLE
from pipeline.files.csv_json import read_json, without_nan
from pipeline.files.shown_text import markdown_list, markdown_table
from pipeline.project import Project
from pipeline.robot import Robot
from pipeline.viewing.playlist import MotionSource, Playlist, Shown

MARKS = "@+~/"
"""Separators between the name of a clip and the rest of a derived clip's name."""

MOST_NAMES = 2_000
"""Maximum number of clips in the list."""

NUMBERS = ("skill", "seconds", "forward_m_s", "lateral_m_s", "yaw_rate_rad_s", "slip_m_s", "penetration_m", "weight")
"""Numbers of a clip to show."""

EXCLUDED = "excluded_by_person"
"""Code of the reason that `pipeline.selection.without_excluded` gives."""


def stored_clips(project: Project, text: str, robot: Robot) -> Playlist:
    """The clip of this name and its derived clips (`name@…`, `name+…`, `name~…`, `name/…`).

    A human recording is shown as the robot clips derived from it. Raises PipelineError with similar names, or with the
    command that makes clips.
    """
    table = read_table(project.store, robot.name)
    sources = MotionSources(table, pieces=True)
    known = sorted({*sources.human, *sources.robot})
    if not known:
        do = f"dagster asset materialize --select {asset_of(DATABASE, robot.name)}"
        raise PipelineError(f"'{text}' is not a file, and the store has no clips yet; to make them: {do}")
    stem = text.rstrip(MARKS)
    found = [name for name in known if name == stem or any(name.startswith(stem + mark) for mark in MARKS)]
    if not found:
        raise PipelineError(f"'{text}' is neither a file nor a clip of the store; similar names: {_near(text, known)}")
    made = [name for name in found if name in sources.robot and "~" not in name]
    names = [stem] if stem in sources.robot else (made or found)[:MOST_NAMES]
    beside = [name for name in found if name not in set(names)][:MOST_NAMES]

    reasons = {name: [] for name in found}
    for manifest in table.manifests.values():
        for clip, given in manifest.findings("clip", "reasons"):
            if given and clip in reasons:
                reasons[clip] += given

    def load(name: str) -> Shown:
        facts = _text(_numbers(sources, name), reasons[name])
        return dataclasses.replace(_source(sources, name).load(project.store, robot), text=facts)

    return Playlist(names=tuple(names), beside=tuple(beside), load=load)


def reference_of(project: Project, rollout: RobotClip, robot: Robot) -> RobotClip | None:
    """The reference frames of a rollout in the database; None for other clips, or if they are not in the store."""
    sources = MotionSources(read_table(project.store, robot.name), pieces=True)
    return _source(sources, rollout.name).load_reference(project.store, rollout)


def _source(sources: MotionSources, name: str) -> MotionSource:
    """The motion source of a clip at its last stage."""
    return sources.of(ClipRow(clip=name, stage="", verdict="", numbers=_numbers(sources, name)))


def _numbers(sources: MotionSources, name: str) -> dict[str, Any]:
    entry = sources.robot.get(name) or sources.human.get(name)
    return entry.numbers if entry else {}


def _near(name: str, names: Sequence[str]) -> str:
    """Similar names, else the first ones."""
    return ", ".join(difflib.get_close_matches(name, names, n=5, cutoff=0.3) or names[:5])


def _text(numbers: dict[str, Any], reasons: list[dict[str, Any]]) -> str:
    known = {name: numbers[name] for name in NUMBERS if numbers.get(name) is not None}
    rows = [(name, f"{value:.3g}" if isinstance(value, float) else value) for name, value in known.items()]
    lines = markdown_list((f"{reason['effect']}: {reason['text']}" for reason in reasons), "")
    return f"{markdown_table(('', ''), rows) if rows else ''}\n\n{lines}"


Row = dict[str, Any]
"""A row of the criteria table; its columns are `criteria_table.COLUMNS`."""


def judged(project: Project, name: str, robot: str) -> list[Row]:
    """Rows of the criteria table for the clip or kept piece of this name, else for all derived clips.

    NaN becomes None. Raises FileError if KP5 has not evaluated anything yet.
    """
    rows = _rows(project, robot)
    for column in ("clip", "piece"):
        own = [row for row in rows if row[column] == name]
        if own:
            return own
    return [row for row in rows if _made_from(row["clip"], name)]


def rejected(project: Project, name: str, robot: str) -> list[ClipRow]:
    """Rows of the clip of this name, or its derived clips, that were rejected before KP5.

    Raises PipelineError with similar names.
    """
    rows = read_table(project.store, robot).rows
    found = [row for row in rows if row.clip == name or _made_from(row.clip, name)]
    if not found:
        near = _near(name, sorted({each for row in rows for each in (row.clip, *row.pieces)}))
        raise PipelineError(f"'{name}' is neither a file nor an evaluated clip; similar names: {near}")
    return found


def _made_from(clip: str, name: str) -> bool:
    return any(clip.startswith(name.rstrip(MARKS) + mark) for mark in MARKS)


def clip_of(database_file: Path) -> str:
    """Name of the clip in a file of the database. Raises FileError."""
    try:
        return str(read_json(database_file)["Clip"])
    except (KeyError, TypeError) as error:
        raise FileError(database_file, f"not a clip of an expert database ({type(error).__name__}).") from error


def excluded(project: Project, rows: Sequence[Row], robot: str) -> dict[str, str]:
    """Clip that KP5 accepted and a person excluded -> the decision as a message."""
    manifest = project.store.load(asset_of(LAST, robot))
    gone = {row["piece"] for row in rows if row["piece"]} - {clip for (clip,) in manifest.kept("clip")}
    if not gone:
        return {}
    clips = {row["clip"] for row in rows}
    given = [reasons for clip, reasons in manifest.findings("clip", "reasons") if clip in clips]
    texts = [reason["text"] for reasons in given for reason in reasons if reason["code"] == EXCLUDED]
    return {piece: text.removeprefix(f"{piece}: ") for piece in gone for text in texts if text.startswith(f"{piece}: ")}


def as_text(rows: Sequence[Row], decisions: Mapping[str, str]) -> str:
    """All criteria of one clip in order of time; for several clips, one line each.

    Args:
        rows: rows of the criteria table
        decisions: clips that a person excluded (`excluded`)
    """
    if len({row["clip"] for row in rows}) > 1:
        return _overview(rows, decisions)
    stretches = itertools.groupby(rows, key=lambda row: (row["start_s"], row["stop_s"]))
    return "\n\n".join(_stretch(list(own), decisions) for _, own in stretches)


def _rows(project: Project, robot: str) -> list[Row]:
    asset = asset_of(LAST, robot)
    manifest = project.store.manifest_path(asset)
    return without_nan(criteria_table.read(criteria_table.path_beside(manifest), manifest, asset).to_dict("records"))


def _stretch(own: Sequence[Row], decisions: Mapping[str, str]) -> str:
    """A table of the criteria of one part of a clip, and the messages of broken ones."""
    first = own[0]
    fate = f"kept as '{first['piece']}'" if first["piece"] else "not kept as a whole"
    if first["piece"] in decisions:
        fate = f"not kept: {decisions[first['piece']]}"
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


def _overview(rows: Sequence[Row], decisions: Mapping[str, str]) -> str:
    """One line per clip."""
    lines = []
    for clip, group in itertools.groupby(rows, key=lambda row: row["clip"]):
        own = list(group)
        pieces = {row["piece"]: row["stop_s"] - row["start_s"] for row in own if row["piece"]}
        kept_s = sum((seconds for piece, seconds in pieces.items() if piece not in decisions), 0.0)
        broken = dict.fromkeys(row["criterion"] for row in own if row["verdict"] == BROKEN)
        why = [*broken, *dict.fromkeys(decisions[piece] for piece in pieces if piece in decisions)]
        lines.append([clip, max(row["stop_s"] for row in own), kept_s, ", ".join(why) or "nothing"])
    return text_table(["clip", "in [s]", "kept [s]", "broken"], lines)
