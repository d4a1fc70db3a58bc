"""Clips that the graph has made, found by name in the store's manifests, and KP5's criteria of them."""

from __future__ import annotations

import dataclasses
import difflib
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.batch import Entry, Manifest, Store
from pipeline.cli.project import Project
from pipeline.cli.text_table import text_table
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import FileError, PipelineError
from pipeline.feasibility import criteria_table
from pipeline.feasibility.criteria_table import BROKEN, NOT_APPLICABLE
from pipeline.files.csv_json import read_json
from pipeline.files.shown_text import escaped, markdown_list
from pipeline.robot import Robot
from pipeline.viewing.contact_sheet import entry_clip
from pipeline.viewing.human_figure import mirrored
from pipeline.viewing.playlist import Playlist, Shown

REFERENCES = "reference_motions"
"""The asset whose clips are tracked."""

HUMAN_ASSETS = ("motion_catalog", "selected_motions", "repaired_motions")
ROBOT_ASSETS = (
    *("retargeted_motions", "motion_variants", REFERENCES),
    *("augmented_motions", "feasible_motions"),
)
"""Assets in the order of the graph; a clip is shown as the last one that has it left it."""

BARE_ROBOT = "t1"
"""The robot whose assets have no prefix."""

MOST_NAMES = 2_000
"""Clips that are offered at once."""

NUMBERS = ("skill", "seconds", "forward_m_s", "lateral_m_s", "yaw_rate_rad_s", "slip_m_s", "penetration_m", "weight")
"""Numbers that are shown, where a clip has them."""


@dataclass(frozen=True, kw_only=True)
class _StoredClips:
    """All clips of the manifests by name, the latest state of each."""

    store: Store
    human: dict[str, Entry]
    robot: dict[str, Entry]
    references: dict[str, Entry]
    """What rollouts tracked."""
    reasons: dict[str, list[dict[str, Any]]]
    """Clip -> reasons of the stages that took it in."""

    def load(self, name: str, robot: Robot) -> Shown:
        entry = self.robot.get(name)
        result = self.store.get_clip(entry.blob, name) if entry is not None else None
        human = self._human(name, result)
        shown = entry or self.human[name]
        return Shown(
            name=name,
            human=human,
            reference=self.reference(entry, result),
            robot_clip=result if isinstance(result, RobotClip) else None,
            robot=robot,
            text=_text(shown.numbers, self.reasons.get(name, [])),
        )

    def reference(self, entry: Entry | None, rollout: Any) -> RobotClip | None:
        """The frames of its reference that a rollout tracked; None for a clip that is no rollout."""
        if entry is None or not isinstance(rollout, RobotClip) or not entry.numbers.get("reference"):
            return None
        tracked = self.references.get(str(entry.numbers["reference"]))
        clip = self.store.get_clip(tracked.blob, tracked.clip) if tracked is not None else None
        start = int(entry.numbers.get("reference_frame") or 0)
        if not isinstance(clip, RobotClip) or start + rollout.frame_count > clip.frame_count:
            return None
        return clip.cut(start, start + rollout.frame_count, clip.name)

    def _human(self, name: str, result: Any) -> HumanClip | None:
        """The human that a robot clip came from, in the same mirror and at the same playing speed."""
        base, *variant = name.split("~")
        entry = self.human.get(base)
        if entry is None:
            return None
        clip = entry_clip(self.store, entry)
        if not isinstance(clip, HumanClip):
            return None
        if "mirror" in variant:
            clip = mirrored(clip)
        scale = next((float(part[1:]) for part in variant if part.startswith("x")), 1.0)
        return dataclasses.replace(clip, fps=clip.fps * scale)


def stored_clips(project: Project, text: str, robot: Robot) -> Playlist:
    """The clip of that name and all that was made from it (`name@…`, `name+…`, `name~…`, `name/…`).

    A recording that is no robot clip itself is shown as the robot clips made from it.
    Raises PipelineError with the names that come near, or with the command that makes clips.
    """
    shelf = _shelf(project.store, robot.name)
    known = sorted({*shelf.human, *shelf.robot})
    if not known:
        do = "dagster asset materialize --select expert_db"
        raise PipelineError(f"'{text}' is no file, and the store has no clips yet; make them with: {do}")
    stem = text.rstrip("@+~/")
    found = [name for name in known if name == stem or any(name.startswith(stem + mark) for mark in "@+~/")]
    if not found:
        near = difflib.get_close_matches(text, known, n=5, cutoff=0.3) or known[:5]
        raise PipelineError(f"'{text}' is neither a file nor a clip of the store; near it are: {', '.join(near)}")
    made = [name for name in found if name in shelf.robot and "~" not in name]
    names = [stem] if stem in shelf.robot else (made or found)[:MOST_NAMES]
    beside = [name for name in found if name not in set(names)][:MOST_NAMES]
    return Playlist(names=tuple(names), beside=tuple(beside), load=lambda name: shelf.load(name, robot))


def reference_of(project: Project, rollout: RobotClip, robot: Robot) -> RobotClip | None:
    """The frames that a rollout of the database tracked; None for another clip, or where the store lacks them."""
    shelf = _shelf(project.store, robot.name)
    return shelf.reference(shelf.robot.get(rollout.name), rollout)


def _shelf(store: Store, robot: str) -> _StoredClips:
    prefix = "" if robot == BARE_ROBOT else f"{robot}/"
    human: dict[str, Entry] = {}
    machine: dict[str, Entry] = {}
    reasons: dict[str, list[dict[str, Any]]] = {}
    for asset, shelf in [(name, human) for name in HUMAN_ASSETS] + [(prefix + name, machine) for name in ROBOT_ASSETS]:
        manifest = _manifest(store, asset)
        shelf.update({entry.clip: entry for entry in manifest.entries})
        for row in manifest.judged:
            reasons.setdefault(row.clip, []).extend(row.reasons)
    references = {entry.clip: entry for entry in _manifest(store, f"{prefix}{REFERENCES}").entries}
    return _StoredClips(store=store, human=human, robot=machine, references=references, reasons=reasons)


def _manifest(store: Store, asset: str) -> Manifest:
    """The asset's manifest, empty where it was never materialized."""
    if not Path(store.manifest_path(asset)).is_file():
        return Manifest(stage=asset, entries=(), judged=())
    return store.load(asset)


def _text(numbers: dict[str, Any], reasons: list[dict[str, Any]]) -> str:
    rows = [
        f"| {escaped(name)} | {escaped(_number(numbers[name]))} |" for name in NUMBERS if numbers.get(name) is not None
    ]
    table = "\n".join(["| | |", "|---|---|", *rows]) if rows else ""
    lines = markdown_list((f"{reason['effect']}: {reason['text']}" for reason in reasons), "")
    return f"{table}\n\n{lines}"


def _number(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


Row = dict[str, Any]
"""A row of the table; its columns are `criteria_table.COLUMNS`."""

_MARKS = "@+~/"
"""What the names of clips made from a clip go on with."""


def judged(project: Project, name: str, robot: str) -> list[Row]:
    """Rows of the table of criteria: of the clip of that name, of the one that was kept under it, or of all clips made
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
