"""Stored motions of each row of the table: the blobs with the human motion and the robot motion of a clip."""

import re
from collections.abc import Mapping
from typing import Any

from pipeline.batch import Entry
from pipeline.curation_page.clip_table import HUMAN_STAGES, REFERENCES, ROBOT_STAGES, ClipRow, ClipTable
from pipeline.viewing.playlist import HumanSource, MotionSource

MIRROR = "mirror"
_SPEED = re.compile(r"x(\d+(?:\.\d+)?)")
_STRETCH = re.compile(r"\+\d+$")
DATABASE_FRAME_S = 0.02
"""Frame period of a reference [s]."""


class MotionSources:
    """Motion sources of the clips of a table.

    Args:
        table: table of all clips
        pieces: whether to show only the part of a clip that KP5 accepted
    """

    def __init__(self, table: ClipTable, *, pieces: bool = False) -> None:
        self.human = _entries(table, HUMAN_STAGES)
        self.robot = _entries(table, ROBOT_STAGES if pieces else ROBOT_STAGES[:-1])
        self._references = _entries(table, (REFERENCES,))

    def of(self, row: ClipRow) -> MotionSource:
        """The source of a row; without motions if no stage could read the clip."""
        entry = self.robot.get(row.clip)
        if entry is None:
            recorded = self.human.get(row.clip)
            if recorded is not None and recorded.numbers.get("kind") == "robot":
                return MotionSource(clip=row.clip, robot=recorded.blob)
            return MotionSource(clip=row.clip, human=self._human_of(row.clip, row.numbers))
        reference = self._references.get(str(entry.numbers.get("reference") or ""))
        frame = int(entry.numbers.get("reference_frame") or 0)
        return MotionSource(
            clip=row.clip,
            human=self._human_of(row.clip, entry.numbers, reference),
            reference=(reference.blob, frame) if reference else None,
            robot=entry.blob,
        )

    def _human_of(self, clip: str, numbers: Mapping[str, Any], reference: Entry | None = None) -> HumanSource | None:
        base, *variant = (_STRETCH.sub("", part) if place else part for place, part in enumerate(clip.split("~")))
        entry = self.human.get(base) or self.human.get(base.rpartition("@")[0])
        if entry is None or entry.numbers.get("kind") == "robot":
            return None
        speed = next((float(match[1]) for part in variant if (match := _SPEED.fullmatch(part))), 1.0)
        start_s = float(reference.numbers.get("stretch_start_s") or 0.0) if reference else 0.0
        start_s += int(numbers.get("reference_frame") or 0) * DATABASE_FRAME_S
        seconds = float(numbers["seconds"]) if reference and numbers.get("seconds") else None
        return HumanSource(
            blob=entry.blob,
            window=_window(entry, {} if variant else numbers),
            mirrored=MIRROR in variant,
            speed=speed,
            start_s=round(start_s, 6),
            seconds=seconds,
        )


def _window(entry: Entry, numbers: Mapping[str, Any]) -> tuple[int, int] | None:
    """First and last frame (exclusive) of a window if the blob is the whole recording (before KP2); else None."""
    in_recording = "floor_m" not in entry.numbers
    own = entry.numbers if entry.numbers.get("start_frame") is not None else numbers
    start, stop = own.get("start_frame"), own.get("stop_frame")
    return (int(start), int(stop)) if in_recording and start is not None and stop is not None else None


def _entries(table: ClipTable, stages: tuple[str, ...]) -> dict[str, Entry]:
    """Name -> clip at the last of the given stages."""
    found: dict[str, Entry] = {}
    for stage in stages:
        if stage in table.manifests:
            found |= {entry.clip: entry for entry in table.manifests[stage].entries}
    return found
