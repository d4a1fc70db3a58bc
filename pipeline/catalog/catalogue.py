"""The catalogue stage: measure and label the motion of one file, correct defects of the whole file."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series
from pipeline.catalog.time_base import CatalogSettings, Person, TimeBase, judge
from pipeline.clips.human_clip import FEET, HumanClip
from pipeline.clips.outcome import Number, Outcome, Piece, Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.files import digest
from pipeline.quality.planar_motion import TELEPORT_M_S, bridge_positions, planar_motion, teleport_share
from pipeline.readers import ReadMotion, Source, read_motion, read_reference, refuse_outside_link


def catalogue_file(path: Path, name: str, source: Source, within: str, *, settings: CatalogSettings) -> Outcome:
    """Read a source's file as a clip and catalogue it. Raises FileError for a file that can't or must not be read.

    Args:
        path: the file
        name: name of its clip
        source: the source it belongs to, with licence and statements
        within: path of the file relative to the source's folder, recorded with the clip
        settings: limits and windows of the catalogue
    """
    refuse_outside_link(path, source.folder)
    statement = source.statement_of(path)
    read = read_motion(path, name, statement)
    read = dataclasses.replace(read, notes=(*read.notes, *source.notes_of(path)))
    reference = read_reference(path, source, read.clip)
    outcome = catalogue(read, settings=settings, rate_is_stated=statement.fps is not None)
    origin: dict[str, Number] = {
        "source": source.name,
        "file": within,
        "file_sha256": digest.of_file(path),
        "licence": source.licence_of(path),
        "credit": source.credit,
    }
    if reference is not None:
        tracks = reference.path.resolve().relative_to(source.folder.resolve()).as_posix()
        origin |= {"tracks": tracks, "tracks_content": reference.content}
    pieces = tuple(dataclasses.replace(piece, numbers={**origin, **piece.numbers}) for piece in outcome.pieces)
    return dataclasses.replace(outcome, pieces=pieces, numbers={**origin, **outcome.numbers})


def catalogue(read: ReadMotion, *, settings: CatalogSettings, rate_is_stated: bool = False) -> Outcome:
    """The clip at its true rate and its numbers; none if rejected. A stated rate may be doubted but is not changed."""
    corrected = correct(read, settings=settings, rate_is_stated=rate_is_stated)
    clip = corrected.clip
    measured = measure(clip, settings, corrected.person)
    reasons = (*read.notes, *corrected.reasons, *_too_little_recorded(clip, measured, settings))
    numbers: dict[str, Number] = {
        "kind": "robot" if isinstance(clip, RobotClip) else "human",
        "format": read.format,
        "skeleton": read.skeleton,
        "unit": read.unit,
        "metres_per_unit": read.metres_per_unit,
        "up_axis": read.up_axis,
        "declared_fps": read.declared_fps,
        "fps": clip.fps,
        "seconds": clip.duration_s,
        **measured,
    }
    if corrected.time_base is not None:
        for name, clock in (("gravity", corrected.time_base.gravity), ("gait", corrected.time_base.gait)):
            numbers[f"fps_by_{name}"] = None if clock is None else round(clock.fps, 1)
    numbers["notes"] = ",".join(sorted({reason.code for reason in reasons}))
    rejected = any(reason.effect == "rejected" for reason in reasons)
    pieces = () if rejected else (Piece(clip=clip, numbers=numbers),)
    return Outcome(pieces=pieces, reasons=reasons, numbers=numbers)


@dataclass(frozen=True, kw_only=True)
class Corrected:
    """A clip without the defects that concern all of its frames."""

    clip: HumanClip | RobotClip
    times_stored: int
    """Number of times that the file stores each frame."""
    first_frame: int
    """Frame of the file that is the clip's first frame."""
    time_base: TimeBase | None
    """Check of the rate; None for a robot, whose gait and size differ from a person's."""
    person: Person | None
    """Evidence for the clip's rate; None for a robot, and if the rate was wrong."""
    reasons: tuple[Reason, ...]


def correct(read: ReadMotion, *, settings: CatalogSettings, rate_is_stated: bool = False) -> Corrected:
    """Remove repeated frames, then correct the frame rate."""
    clip, reasons = read.clip, []
    times, first = times_stored(clip, settings.repeated_share)
    if times > 1:
        often = {2: "twice", 3: "three times"}.get(times, f"{times} times")
        text = f"every frame is stored {often}: {clip.fps:g} Hz hold {clip.fps / times:g} Hz; one of each is kept"
        reasons.append(Reason(code="doubled_frames", text=text, effect="repaired", value=float(times), limit=1.0))
        clip = each_once(clip, times, first)
    time_base = person = None
    if isinstance(clip, HumanClip):
        person = Person(clip=bridge_positions(clip, settings.bridge_s))
        time_base = judge(person, read.skeleton, settings.time_base)
    if time_base is not None and time_base.contradicted:
        reason = _contradicted(clip, time_base, rate_is_stated)
        reasons.append(reason)
        if reason.effect == "repaired" and time_base.fps is not None:
            clip, person = dataclasses.replace(clip, fps=time_base.fps), None
    return Corrected(
        clip=clip,
        times_stored=times,
        first_frame=first,
        time_base=time_base,
        person=person,
        reasons=tuple(reasons),
    )


MOSTLY = 0.5
"""Share of implausibly fast root steps from which these are the reason for rejecting a file."""


def _too_little_recorded(
    clip: HumanClip | RobotClip, measured: Mapping[str, Number], settings: CatalogSettings
) -> tuple[Reason, ...]:
    """The reason why a file can't be evaluated; empty if it can."""
    share, least = float(measured["recorded_share"] or 0.0), settings.least_recorded_share
    if share >= least:
        return ()
    if measured["speed_mean"] is None:
        found = f"of {clip.frame_count} frames none is in a stretch of {settings.velocity_s:g} s, which a speed needs"
    else:
        found = (
            f"where a speed can be measured {share:.0%} of the frames were recorded, at least {least:.0%} are needed"
        )
    why, fast = "root or hips are missing in the others", teleport_share(clip)
    if fast > MOSTLY:
        why = f"in {fast:.0%} of the steps the root is faster than {TELEPORT_M_S:g} m/s: its unit or the rate is wrong"
    text = f"{found}; {why}"
    return (Reason(code="too_little_recorded", text=text, effect="rejected", value=share, limit=least),)


def _contradicted(clip: HumanClip | RobotClip, time_base: TimeBase, rate_is_stated: bool) -> Reason:
    """The reason for a contradicted rate, with its effect."""
    evidence = " and ".join(clock.text for clock in (time_base.gravity, time_base.gait) if clock is not None)
    text = f"at {clip.fps:g} Hz {evidence}"
    if rate_is_stated:
        effect, then = "noted", "the stated rate stays"
    elif not time_base.certain:
        effect, then = "noted", "that is not enough to call the rate wrong"
    elif time_base.fps is not None:
        effect, then = "repaired", f"the motion was made at {time_base.fps:g} Hz, which is taken"
    else:
        choice = " or ".join(f"{rate:g} Hz" for rate in sorted(time_base.candidates)) or "no standard rate"
        effect, then = "rejected", f"{choice} would explain it; state `fps:` for the file in data/sources.yaml"
    return Reason(
        code="time_base",
        text=f"{text}: {then}",
        effect=effect,
        value=None if time_base.ratio is None else round(time_base.ratio, 3),
        limit=time_base.limit,
    )


MOST_TIMES = 8
"""Most repetitions of a frame that are detected."""
NO_STEP = 1e-7
"""Largest step between repeated frames [m or rad], due to rounding."""
LEAST_MOVED = 0.5
"""Least share of distinct frames that differ from the previous one, since a frozen clip shows no pattern."""
LEAST_SEEN = 0.5
"""Least share of the other steps that are known; steps next to a missing frame are unknown."""


def times_stored(clip: HumanClip | RobotClip, share: float) -> tuple[int, int]:
    """Number of repetitions of each frame, and the file's frame at which the first complete group begins.

    `(1, 0)` for a clip without repetitions, and for one that hardly moves. At least `share` of all steps must be in the
    pattern.
    """
    step = _steps(clip)
    moved, known = np.nan_to_num(step) > NO_STEP, np.isfinite(step)
    if len(step) < 2 * MOST_TIMES or not moved.any():
        return 1, 0
    for times in range(MOST_TIMES, 1, -1):
        counts = np.array([moved[phase::times].sum() for phase in range(times)])
        phase = int(np.argmax(counts))
        slots = known[phase::times].sum()
        if known.sum() - slots < LEAST_SEEN * (len(step) - slots):
            continue
        if counts[phase] >= share * counts.sum() and counts[phase] >= LEAST_MOVED * slots:
            return times, (phase + 1) % times
    return 1, 0


def each_once(clip: HumanClip | RobotClip, times: int, first: int) -> HumanClip | RobotClip:
    """Every `times`-th frame from `first`, at the rate that keeps the clip's duration."""
    taken = {name: each[first::times].copy() for name, each in vars(clip).items() if isinstance(each, np.ndarray)}
    return dataclasses.replace(clip, fps=clip.fps / times, **taken)


def _steps(clip: HumanClip | RobotClip) -> Float[np.ndarray, " steps"]:
    """Largest change from each frame to the next: of a person's joint positions [m], of a robot's joints [rad]."""
    if isinstance(clip, HumanClip):
        return rotation.length(np.diff(clip.body_pos_w, axis=0)).max(axis=1)
    return np.abs(np.diff(clip.joint_pos, axis=0)).max(axis=1)


def measure(clip: HumanClip | RobotClip, settings: CatalogSettings, person: Person | None = None) -> dict[str, Number]:
    """Frames, missing frames, speeds [m/s], yaw rates [rad/s]; of a person also gait, legs and feet.

    `recorded_share`: share of the frames with a speed that were recorded, not interpolated.

    Short gaps are interpolated first (`person`, if already computed). Quantities that cannot be measured are None.
    """
    motion = planar_motion(clip, settings.velocity_s, settings.facing_s, settings.bridge_s)
    speed, yaw_rate = motion.speed[motion.valid], motion.yaw_rate[motion.valid]
    numbers: dict[str, Number] = {
        "frames": clip.frame_count,
        "missing_frames": missing_frames(clip),
        "recorded_share": _round(motion.recorded[motion.valid].mean()) if len(speed) else 0.0,
        "speed_mean": _round(speed.mean()) if len(speed) else None,
        "speed_max": _round(speed.max()) if len(speed) else None,
        "yaw_rate_mean": _round(yaw_rate.mean()) if len(speed) else None,
        "yaw_rate_max": _round(np.abs(yaw_rate).max()) if len(speed) else None,
    }
    if not isinstance(clip, HumanClip):
        return numbers
    person = person or Person(clip=bridge_positions(clip, settings.bridge_s))
    rate, leg = person.step_rate, person.leg_length
    return {
        **numbers,
        "leg_length": _round(leg) if np.isfinite(leg) else None,
        "cadence_per_min": None if rate is None else _round(60.0 * rate * clip.fps),
        "flight_share": _round(person.flights.frames.sum() / clip.frame_count),
        "stance_foot_speed": _stance_foot_speed(person.clip),
    }


def missing_frames(clip: HumanClip | RobotClip) -> int:
    """Number of frames with missing values."""
    arrays = [each for each in vars(clip).values() if isinstance(each, np.ndarray) and each.dtype.kind == "f"]
    return int(np.any([~np.isfinite(each.reshape(clip.frame_count, -1)).all(axis=1) for each in arrays], axis=0).sum())


def _stance_foot_speed(clip: HumanClip) -> float | None:
    """Mean horizontal speed of the slowest of both ankles and balls [m/s]: foot skating if one foot is in stance."""
    points = np.stack([clip.pos(f"{side}_{part}")[:, :2] for side in FEET for part in ("ankle", "toe")], axis=1)
    slowest = np.linalg.norm(time_series.derivative(points, clip.fps), axis=2).min(axis=1)
    known = slowest[np.isfinite(slowest)]
    return _round(known.mean()) if len(known) else None


def _round(value: float | np.floating) -> float:
    """Four decimals, for a table."""
    return round(float(value), 4)
