"""Comparison of two versions of a database: added, removed and changed clips, and why clips were removed."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipeline.curation_page.clip_table import ClipTable
from pipeline.errors import FileError, UnknownNameError
from pipeline.expert import history, index
from pipeline.files.csv_json import without_nan
from pipeline.selection.curation import Decision, exclusions

CURRENT = "current"
COLUMNS = ("clip", "file", "sha256", "seconds", "weight", "skill", "source")
WEIGHT_TOLERANCE = 1e-9
WEIGHT_LINE = b'"MotionWeight":'


def versions(folder: Path) -> list[history.Version]:
    """Versions of the database: the current one, then earlier ones from new to old."""
    found = history.read_versions(folder)
    try:
        return [history.describe(folder, CURRENT), *found]
    except FileError:
        return found


def compare(folder: Path, before: str, after: str, table: ClipTable, decisions: tuple[Decision, ...]) -> dict[str, Any]:
    """Compare two versions: added (`came`), removed (`left`) and changed clips, and changed weights, as JSON types.

    The reason for a removal comes from the current manifests, so it is only valid if `after` is the current version.
    Raises UnknownNameError, FileError.

    Args:
        folder: folder of the database
        before: name of the earlier version
        after: name of the later version
        table: table of all clips
        decisions: decisions on clips
    """
    known = {each.name: each for each in versions(folder)}
    for name in (before, after):
        if name not in known:
            raise UnknownNameError("version", name, list(known))
    old, new = (_read(known[name].folder) for name in (before, after))
    excluded = exclusions(decisions)
    left = [{**old[clip], "why": _why_absent(clip, table, excluded)} for clip in sorted(old.keys() - new.keys())]
    both = sorted(old.keys() & new.keys())
    folders = (known[before].folder, known[after].folder)
    changed = [
        clip
        for clip in both
        if old[clip]["sha256"] != new[clip]["sha256"]
        and not _differ_only_in_weight(folders[0] / old[clip]["file"], folders[1] / new[clip]["file"])
    ]
    moved = [clip for clip in both if abs(old[clip]["weight"] - new[clip]["weight"]) > WEIGHT_TOLERANCE]
    return {
        "before": _summary(known[before], old),
        "after": _summary(known[after], new),
        "came": [new[clip] for clip in sorted(new.keys() - old.keys())],
        "left": left,
        "changed": len(changed),
        "weighted": [
            {"clip": clip, "before": old[clip]["weight"], "after": new[clip]["weight"]}
            for clip in sorted(moved, key=lambda clip: -abs(new[clip]["weight"] - old[clip]["weight"]))[:200]
        ],
        "weights_changed": len(moved),
    }


def _differ_only_in_weight(one: Path, other: Path) -> bool:
    """Whether two clip files are equal except for the line with the weight; False if a file is missing."""
    try:
        lines = zip(one.read_bytes().splitlines(), other.read_bytes().splitlines(), strict=True)
        return all(a == b or (a.startswith(WEIGHT_LINE) and b.startswith(WEIGHT_LINE)) for a, b in lines)
    except (OSError, ValueError):
        return False


def _why_absent(clip: str, table: ClipTable, excluded: Mapping[str, Decision]) -> str:
    """Why a clip is not in the current database: the reasons of the clip, or of its nearest rejected ancestor."""
    names = [clip, *sorted({clip[:place] for place, letter in enumerate(clip) if letter in "@+~"}, key=len)[::-1]]
    for name in names:
        if name in excluded:
            return excluded[name].text()
    for name in names:
        row = table.row(name)
        texts = [str(each["text"]) for each in row.reasons if each.get("effect") == "rejected"] if row else []
        if texts:
            return "; ".join(texts)
    return (
        "no stage produces a clip of this name now: its recording was removed from the sources, or its window changed"
    )


def _read(folder: Path) -> dict[str, dict[str, Any]]:
    """Clip -> its row of the index. Raises FileError."""
    path = folder / index.FILE
    try:
        table = index.read_table(path)
        rows = without_nan(table.reindex(columns=list(COLUMNS)).to_dict("records"))
    except (ValueError, KeyError) as error:
        raise FileError(path, f"not a readable index ({error}).", "Materialize expert_db again.") from error
    return {str(row["clip"]): row for row in rows}


def _summary(version: history.Version, rows: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    seconds: dict[str, float] = {}
    for row in rows.values():
        seconds[str(row["skill"])] = seconds.get(str(row["skill"]), 0.0) + float(row["seconds"] or 0.0)
    by_skill = {skill: round(value, 2) for skill, value in sorted(seconds.items())}
    return {"name": version.name, "clips": version.clips, "seconds": version.seconds, "seconds_by_skill": by_skill}
