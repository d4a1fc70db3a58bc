"""KP1 for one clip: segment it into windows of one skill; the windows are its pieces."""

import dataclasses
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import time_series
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import LABELS, SKILLS, TRANSITION, Numbers, Outcome, Piece
from pipeline.clips.robot_clip import RobotClip
from pipeline.quality.planar_motion import PlanarMotion, planar_motion
from pipeline.selection.curation import Curation, WindowSettings
from pipeline.selection.skills import distances, segment

NEVER = 1e3
"""Cost of a forbidden label [m/s]."""


@dataclass(frozen=True, kw_only=True)
class Window:
    """Frames [start, stop) of a clip with one skill, and means over the frames with known motion."""

    skill: str
    start: int
    stop: int
    recorded_share: float
    """Share of the frames in which root and facing were recorded."""
    forward_m_s: float = 0.0
    lateral_m_s: float = 0.0
    """Positive to the left."""
    yaw_rate_rad_s: float = 0.0
    """Positive to the left."""
    off_skill_m_s: float = 0.0
    """Mean distance of the frames from the skill's region; 0 for a transition."""


def find_windows(clip: HumanClip | RobotClip, *, settings: WindowSettings) -> tuple[Window, ...]:
    """The clip's windows in order and without gaps, none of a skill shorter than allowed.

    Only a clip that is shorter as a whole, or the remainder beside a long gap of the recording, becomes a shorter
    transition. Short gaps and teleports are interpolated, long ones are transitions.
    """
    motion = planar_motion(clip, settings.velocity_s, settings.facing_s, settings.bridge_s)
    cost = _costs(motion, clip.fps, settings)
    shortest = np.array([settings.shortest_s] * len(SKILLS) + [settings.shortest_transition_s])
    frames = np.maximum(np.round(shortest * settings.label_hz).astype(int), 1)
    if len(cost) < frames[0]:
        stretches = [(0, len(cost), len(SKILLS))]
    else:
        stretches = segment(cost / settings.label_hz, frames, settings.cut_price)
    edges = [min(round(start * clip.fps / settings.label_hz), clip.frame_count) for start, _, _ in stretches]
    edges.append(clip.frame_count)
    labels = [LABELS[label] for _, _, label in stretches]
    return tuple(
        _measured(motion, label, start, stop, settings)
        for label, start, stop in zip(labels, edges[:-1], edges[1:], strict=True)
        if stop > start
    )


def _costs(motion: PlanarMotion, fps: float, settings: WindowSettings) -> Float[np.ndarray, "n 11"]:
    """Cost [m/s] of each label at the labelling rate; in a long gap of the recording only a transition is cheap."""
    times_s = time_series.resample_times(len(motion.valid), fps, settings.label_hz)
    forward, lateral, yaw_rate = (
        time_series.resample_linear(each, fps, times_s) for each in (motion.forward, motion.lateral, motion.yaw_rate)
    )
    away = distances(forward, lateral, yaw_rate, settings.bounds)
    cost = np.concatenate([away, np.full((len(away), 1), settings.transition_cost)], axis=1)
    unknown = ~time_series.resample_nearest(motion.valid, fps, times_s)
    cost[unknown] = 0.0
    gap = np.zeros(len(cost), dtype=bool)
    for start, stop in time_series.runs(unknown):
        gap[start:stop] = stop - start > settings.bridge_s * settings.label_hz
    cost[gap, : len(SKILLS)] = NEVER
    return cost


def _measured(motion: PlanarMotion, label: str, start: int, stop: int, settings: WindowSettings) -> Window:
    recorded = float(motion.recorded[start:stop].mean())
    known = np.flatnonzero(motion.valid[start:stop]) + start
    if len(known) == 0:
        return Window(skill=TRANSITION, start=start, stop=stop, recorded_share=recorded)
    forward, lateral, yaw_rate = motion.forward[known], motion.lateral[known], motion.yaw_rate[known]
    off = 0.0
    if label != TRANSITION:
        off = float(distances(forward, lateral, yaw_rate, settings.bounds)[:, SKILLS.index(label)].mean())
    return Window(
        skill=label,
        start=start,
        stop=stop,
        recorded_share=recorded,
        forward_m_s=float(forward.mean()),
        lateral_m_s=float(lateral.mean()),
        yaw_rate_rad_s=float(yaw_rate.mean()),
        off_skill_m_s=off,
    )


def process(clip: HumanClip | RobotClip, numbers: Numbers, *, settings: Curation) -> Outcome:
    """One piece per window, named `<clip>@<first>-<last>` by its frames.

    A piece contains the whole clip, as context for KP2; `start_frame` and `stop_frame` (exclusive) are the window's
    frames.
    """
    windows = find_windows(clip, settings=settings.windows)
    pieces = tuple(_piece(clip, window) for window in windows)
    seconds = {label: sum(_seconds(clip, each) for each in windows if each.skill == label) for label in LABELS}
    shown = {f"seconds_{label}": value for label, value in seconds.items() if value > 0.0}
    return Outcome(pieces=pieces, numbers={"windows": len(windows), **shown})


def _seconds(clip: HumanClip | RobotClip, window: Window) -> float:
    return (window.stop - window.start) / clip.fps


def _piece(clip: HumanClip | RobotClip, window: Window) -> Piece:
    means = ("forward_m_s", "lateral_m_s", "yaw_rate_rad_s", "off_skill_m_s", "recorded_share")
    return Piece(
        clip=dataclasses.replace(clip, name=f"{clip.name}@{window.start}-{window.stop - 1}"),
        numbers={
            "skill": window.skill,
            "start_frame": window.start,
            "stop_frame": window.stop,
            "seconds": _seconds(clip, window),
            **{name: getattr(window, name) for name in means},
        },
    )
