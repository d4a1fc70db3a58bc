"""KP5 on one clip: judged as a whole, cut where frames are to blame, the rest judged again on its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline import time_series
from pipeline.clips.outcome import Numbers, Outcome, Piece, Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.feasibility.assess import Assessment, assess
from pipeline.feasibility.likeness_criteria import likeness
from pipeline.feasibility.motion import Motion, motion_of
from pipeline.feasibility.settings import CutSettings, FeasibilitySettings
from pipeline.robot import Robot

MAX_CUTS = 3
"""How often what is left of a clip is cut again; a cut moves the ends that filters see."""


@dataclass(frozen=True, kw_only=True)
class _Stretch:
    """Part of the input [start, stop) that holds on its own."""

    start: int
    stop: int
    assessment: Assessment


def process(clip: RobotClip, numbers: Numbers, *, settings: FeasibilitySettings, robot: Robot) -> Outcome:
    """What of a clip the robot can do, with a number a criterion and every reason against the rest.

    A clip that holds goes on whole and under its name. Else the frames that broken criteria blame are cut out
    with a margin, and stretches of `settings.cut.min_seconds` or more are judged again as clips of their own;
    those that hold go on as `<name>+<n>`. So everything that goes on satisfies all criteria by itself. A clip
    that KP3 could not bring close enough to the human does not go on at all.
    Raises ClipError where the clip is not this robot's or holds numbers that are not finite.
    """
    _check(clip, robot)
    motion = motion_of(clip, robot, settings)
    whole = assess(motion, settings)
    reasons: list[Reason] = []
    stretches = _judge(whole, 0, settings, reasons, MAX_CUTS)
    unlike = [verdict for verdict in likeness(numbers, settings.likeness) if not verdict.holds]
    if unlike:
        stretches = []
        reasons[:0] = [verdict.reason(motion.clip.fps, 0.0, motion.clip.duration_s) for verdict in unlike]
    pieces = tuple(_piece(stretch, index, motion, numbers) for index, stretch in enumerate(stretches))
    kept_s = sum(piece.clip.duration_s for piece in pieces)
    found = {**whole.numbers(), "seconds": motion.clip.duration_s, "kept_seconds": kept_s}
    return Outcome(pieces=pieces, reasons=tuple(reasons), numbers=found)


def _judge(
    found: Assessment, offset: int, settings: FeasibilitySettings, reasons: list[Reason], cuts_left: int
) -> list[_Stretch]:
    """Stretches of a motion that hold; `offset` is its first frame in the input."""
    motion = found.motion
    count, fps = motion.clip.frame_count, motion.clip.fps
    if count / fps < settings.cut.min_seconds:
        reasons.append(_too_short(offset, count, fps, settings.cut))
        return []
    if found.holds:
        return [_Stretch(start=offset, stop=offset + count, assessment=found)]
    reasons += [verdict.reason(fps, offset / fps, (offset + count) / fps) for verdict in found.broken]
    bad = found.bad
    if cuts_left == 0 or not bad.any():
        return []
    kept: list[_Stretch] = []
    for start, stop in _remaining(bad, fps, settings.cut):
        part = assess(motion.cut(start, stop, settings), settings)
        kept += _judge(part, offset + start, settings, reasons, cuts_left - 1)
    return kept


def _remaining(bad: np.ndarray, fps: float, settings: CutSettings) -> list[tuple[int, int]]:
    """Stretches that are left when bad frames and their margins are gone and that are long enough."""
    margin = round(settings.margin_s * fps)
    wide = np.convolve(bad, np.ones(2 * margin + 1), mode="same") > 0.5
    shortest = settings.min_seconds * fps
    return [(start, stop) for start, stop in time_series.runs(~wide) if stop - start >= shortest]


def _piece(stretch: _Stretch, index: int, motion: Motion, numbers: Numbers) -> Piece:
    """A stretch as a clip, with its place in the input [s]: frame k of it is at `stretch_start_s` + k / 50 there."""
    whole = stretch.stop - stretch.start == motion.clip.frame_count
    name = motion.clip.name if whole else f"{motion.clip.name}+{index}"
    clip = motion.clip.cut(stretch.start, stretch.stop, name)
    found = stretch.assessment.numbers()
    fps = motion.clip.fps
    place = {"stretch_start_s": stretch.start / fps, "stretch_stop_s": stretch.stop / fps}
    return Piece(clip=clip, numbers={**numbers, **found, **place, "seconds": clip.duration_s})


def _too_short(offset: int, count: int, fps: float, settings: CutSettings) -> Reason:
    return Reason(
        code="too_short",
        text=f"only {count / fps:.2f} s long; at least {settings.min_seconds:g} s are wanted.",
        effect="rejected",
        start_s=offset / fps,
        stop_s=(offset + count) / fps,
        value=count / fps,
        limit=settings.min_seconds,
        unit="s",
    )


def _check(clip: RobotClip, robot: Robot) -> None:
    if clip.joint_names != robot.joint_names:
        raise ClipError(clip.name, "joints", f"its joints are not those of '{robot.name}', or in another order")
    for name in ("root_pos_w", "root_quat_w", "joint_pos"):
        finite = np.isfinite(getattr(clip, name)).all(axis=1)
        if not finite.all():
            raise ClipError(clip.name, "not_finite", f"{name} has numbers that are not finite", int(np.argmin(finite)))
    if clip.frame_count < 2:
        raise ClipError(clip.name, "too_short", "has less than two frames")
