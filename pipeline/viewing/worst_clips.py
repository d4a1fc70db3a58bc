"""Picture of the clips that lost the most in a stage, with the reasons."""

from __future__ import annotations

from pipeline.batch import Entry, Judged, Manifest, Store
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Clip
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.viewing.contact_sheet import Strip, worst_clips_sheet


def entry_clip(store: Store, entry: Entry) -> Clip:
    """The clip, cut to its window if it is a selected window of a human motion.

    KP1 keeps the whole recording with each window (`start_frame`, `stop_frame`); from KP2 on the clip is the window.
    """
    clip = store.get_clip(entry.blob, entry.clip)
    start, stop = entry.numbers.get("start_frame"), entry.numbers.get("stop_frame")
    if not isinstance(clip, HumanClip) or start is None or stop is None or stop - start >= clip.frame_count:
        return clip
    return clip.cut(int(start), int(stop), clip.name)


LEAST_LOST_S = 0.1
"""Least loss that is shown [s]; less comes from rounding to frames."""


def worst_clips(stage: Manifest, previous: Manifest, store: Store, robot: Robot | None, most: int = 5) -> bytes:
    """PNG of the clips that lost the most seconds in a stage, as they were before it, with the first reason.

    One clip of each family (`walk@0-99`, `walk@0-99~mirror`, …) is shown, so that variants don't fill the sheet.

    Args:
        stage: manifest of the stage
        previous: the stage before it, which has the clips
        robot: the one that robot clips are for
        most: clips in the picture
    """
    entries = {entry.clip: entry for entry in previous.entries}
    families: dict[str, Judged] = {}
    for row in sorted(stage.judged, key=lambda row: (-_lost_s(row), row.clip)):
        if _lost_s(row) > LEAST_LOST_S and row.clip in entries:
            families.setdefault(row.clip.split("~")[0], row)
    strips = []
    for row in list(families.values())[:most]:
        clip = entry_clip(store, entries[row.clip])
        why = next((reason["text"] for reason in row.reasons if reason["effect"] == "rejected"), "")
        strips.append(
            Strip(
                title=row.clip,
                note=why,
                human=clip if isinstance(clip, HumanClip) else None,
                robot_clip=clip if isinstance(clip, RobotClip) else None,
            )
        )
    return worst_clips_sheet(strips, robot)


def _lost_s(row: Judged) -> float:
    return float(row.numbers.get("seconds_in") or 0.0) - float(row.numbers.get("seconds_out") or 0.0)
