"""KP5 for one clip: evaluate it as a whole, cut the bad frames, evaluate the remaining stretches separately."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import msgspec
import numpy as np

from pipeline import time_series
from pipeline.clips.outcome import Numbers, Outcome, Piece, Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.feasibility.assess import Assessment, assess, parted
from pipeline.feasibility.clip_criteria import length
from pipeline.feasibility.criterion import NUMBERS, Result, results
from pipeline.feasibility.image import LastAssessed, assess_clip, assess_image, is_image, is_rollout
from pipeline.feasibility.judgement import NUMBER, Judgement, judge, to_text
from pipeline.feasibility.motion import CutSettings, Motion, at_database_rate, motion_of
from pipeline.feasibility.reference import CLIP, FRAME, References, no_references, reference_of, why_none
from pipeline.feasibility.settings import FeasibilitySettings
from pipeline.robot import Robot
from pipeline.robot.size import scaled


@dataclass(frozen=True, kw_only=True)
class _Stretch:
    """Part of the input [start, stop) that passes all criteria by itself."""

    start: int
    stop: int
    assessment: Assessment


@dataclass(frozen=True, kw_only=True)
class _Gathered:
    """Results collected while a clip is evaluated and cut."""

    reasons: list[Reason]
    judgements: list[Judgement]
    of_clip: tuple[Result, ...]
    """Results for the whole clip: likeness, and the share of its reference that a rollout followed."""


def process(
    clip: RobotClip,
    numbers: Numbers,
    *,
    settings: FeasibilitySettings,
    robot: Robot,
    references: References = no_references,
    prepared: LastAssessed | None = None,
) -> Outcome:
    """The feasible parts of a clip, with a number per criterion and all reasons against the rest.

    A clip that passes all criteria is kept whole, under its name. Otherwise bad frames are cut with a margin, and
    stretches of `settings.cut.min_seconds` or more are evaluated again as separate clips; those that pass are kept as
    `<name>+<n>`. So every kept clip satisfies all criteria by itself. A clip that is not similar enough to the human
    (numbers of KP3) is rejected as a whole. The results of all criteria on every evaluated stretch are stored as text
    among the numbers (`judgement.NUMBER`). Thresholds are scaled to the robot (`pipeline.robot.size`).

    Args:
        clip: motion of the robot
        numbers: numbers of earlier stages
        settings: thresholds
        robot: robot of the clip
        references: motions that rollouts tracked
        prepared: cache with the last assessment, by which a mirror image is assessed (`pipeline.feasibility.image`)

    Raises ClipError if the clip is not of this robot or has values that are not finite.
    """
    _check(clip, robot)
    settings = scaled(settings, robot)
    last = prepared or LastAssessed()
    if is_image(clip, numbers, robot):
        whole = assess_image(clip, robot, settings, last)
    elif is_rollout(clip, numbers):
        reference = reference_of(at_database_rate(clip), numbers, robot, references)
        whole = assess(motion_of(clip, robot, settings, reference, why_none(numbers)), settings)
    else:
        whole = assess_clip(clip, robot, settings, last)
    motion = whole.motion
    of_clip = tuple(results(numbers, settings, NUMBERS))
    gathered = _Gathered(reasons=[], judgements=[], of_clip=of_clip)
    stretches = _judge(whole, 0, settings, gathered, settings.cut.max_cuts)
    reasons = gathered.reasons
    unlike = [verdict for verdict in parted(of_clip)[0] if not verdict.holds]
    if unlike:
        stretches = []
        reasons[:0] = [verdict.reason(motion.clip.fps, 0.0, motion.clip.duration_s) for verdict in unlike]
    pieces = tuple(_piece(stretch, index, motion, numbers) for index, stretch in enumerate(stretches))
    kept_s = sum(piece.clip.duration_s for piece in pieces)
    fps = motion.clip.fps
    places = [(stretch.start / fps, stretch.stop / fps) for stretch in stretches]
    names = {place: piece.clip.name for place, piece in zip(places, pieces, strict=True)}
    judgements = to_text([_with_piece(each, names) for each in gathered.judgements])
    found = {**whole.numbers, "seconds": motion.clip.duration_s, "kept_seconds": kept_s, NUMBER: judgements}
    return Outcome(pieces=pieces, reasons=tuple(reasons), numbers=found)


def _judge(
    found: Assessment, offset: int, settings: FeasibilitySettings, gathered: _Gathered, cuts_left: int
) -> list[_Stretch]:
    """Stretches of a motion that pass all criteria; `offset` is its first frame in the input."""
    motion = found.motion
    count, fps = motion.clip.frame_count, motion.clip.fps
    (own_length,) = length(count / fps, settings.cut)
    gathered.judgements.append(judge(found, (*gathered.of_clip, own_length), offset))
    if not own_length.holds:
        gathered.reasons.append(own_length.reason(fps, offset / fps, (offset + count) / fps))
        return []
    if found.holds:
        return [_Stretch(start=offset, stop=offset + count, assessment=found)]
    gathered.reasons.extend(verdict.reason(fps, offset / fps, (offset + count) / fps) for verdict in found.broken)
    bad = found.bad
    if cuts_left == 0 or not bad.any():
        return []
    kept: list[_Stretch] = []
    for start, stop in _remaining(bad, fps, settings.cut):
        part = assess(motion.cut(start, stop, settings), settings)
        kept += _judge(part, offset + start, settings, gathered, cuts_left - 1)
    return kept


def _with_piece(judgement: Judgement, names: Mapping[tuple[float, float], str]) -> Judgement:
    """Add the name of the piece made from the stretch; `names` has the pieces by start and end [s]."""
    return msgspec.structs.replace(judgement, piece=names.get((judgement.start_s, judgement.stop_s), ""))


def _remaining(bad: np.ndarray, fps: float, settings: CutSettings) -> list[tuple[int, int]]:
    """Stretches [start, stop) between bad frames and their margins that are long enough."""
    margin = round(settings.margin_s * fps)
    wide = np.convolve(bad, np.ones(2 * margin + 1), mode="same") > 0.5
    shortest = settings.min_seconds * fps
    return [(start, stop) for start, stop in time_series.runs(~wide) if stop - start >= shortest]


def _piece(stretch: _Stretch, index: int, motion: Motion, numbers: Numbers) -> Piece:
    """A stretch as a clip, with its position in the variant [s]: its frame k is at `stretch_start_s` + k / 50 there.

    The input may already be a stretch of the variant; for a rollout of KP4 its position in the reference is kept as
    well.
    """
    whole = stretch.stop - stretch.start == motion.clip.frame_count
    name = motion.clip.name if whole else f"{motion.clip.name}+{index}"
    clip = dataclasses.replace(stretch.assessment.motion.clip, name=name)  # exactly the evaluated arrays
    found = stretch.assessment.numbers
    fps = motion.clip.fps
    before_s = float(numbers.get("stretch_start_s") or 0.0)
    place: dict[str, float | int] = {
        "stretch_start_s": before_s + stretch.start / fps,
        "stretch_stop_s": before_s + stretch.stop / fps,
    }
    if numbers.get(CLIP):
        place[FRAME] = int(numbers.get(FRAME) or 0) + stretch.start
    return Piece(clip=clip, numbers={**numbers, **found, **place, "seconds": clip.duration_s})


def _check(clip: RobotClip, robot: Robot) -> None:
    if clip.joint_names != robot.joint_names:
        raise ClipError(clip.name, "joints", f"its joints are not those of '{robot.name}', or in another order")
    for name in ("root_pos_w", "root_quat_w", "joint_pos"):
        finite = np.isfinite(getattr(clip, name)).all(axis=1)
        if not finite.all():
            raise ClipError(clip.name, "not_finite", f"{name} has numbers that are not finite", int(np.argmin(finite)))
    if clip.frame_count < 2:
        raise ClipError(clip.name, "too_short", "has less than two frames")
