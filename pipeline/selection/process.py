"""The stage for one clip: its windows as pieces."""

from __future__ import annotations

import dataclasses

from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Numbers, Outcome, Piece
from pipeline.clips.robot_clip import RobotClip
from pipeline.selection.curation import Curation
from pipeline.selection.skills import LABELS
from pipeline.selection.windows import Window, find_windows


def process(clip: HumanClip | RobotClip, numbers: Numbers, *, settings: Curation) -> Outcome:
    """One piece a window, named `<clip>@<first>-<last>` by its frames.

    A piece holds the whole clip, so that KP2 sees what is before and after the window; `start_frame` and
    `stop_frame` (exclusive) say which frames are the window's.
    """
    windows = find_windows(clip, settings=settings.windows)
    pieces = tuple(_piece(clip, window) for window in windows)
    seconds = {label: sum(_seconds(clip, each) for each in windows if each.skill == label) for label in LABELS}
    shown = {f"seconds_{label}": value for label, value in seconds.items() if value > 0.0}
    return Outcome(pieces=pieces, numbers={"windows": len(windows), **shown})


def _seconds(clip: HumanClip | RobotClip, window: Window) -> float:
    return (window.stop - window.start) / clip.fps


def _piece(clip: HumanClip | RobotClip, window: Window) -> Piece:
    return Piece(
        clip=dataclasses.replace(clip, name=f"{clip.name}@{window.start}-{window.stop - 1}"),
        numbers={
            "skill": window.skill,
            "start_frame": window.start,
            "stop_frame": window.stop,
            "seconds": _seconds(clip, window),
            "forward_m_s": window.forward_m_s,
            "lateral_m_s": window.lateral_m_s,
            "yaw_rate_rad_s": window.yaw_rate_rad_s,
            "off_skill_m_s": window.off_skill_m_s,
            "recorded_share": window.recorded_share,
        },
    )
