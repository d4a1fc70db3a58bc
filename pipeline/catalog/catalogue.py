"""The stage: one file's motion, measured and labelled, with the defects of the whole file corrected."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pipeline.catalog.gait import Person
from pipeline.catalog.measure import bridged, each_once, measure, times_stored
from pipeline.catalog.time_base import CatalogSettings, TimeBase, judge
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Number, Outcome, Piece, Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.files import digest
from pipeline.readers import ReadMotion, Source, read_motion, read_reference, refuse_outside_link


def catalogue_file(path: Path, name: str, source: Source, within: str, *, settings: CatalogSettings) -> Outcome:
    """Read a source's file as the clip `name` and catalogue it. Raises FileError for what cannot or must not be read.

    Args:
        path: the file
        name: name of its clip
        source: the folder it belongs to, with licence and statements
        within: path of the file in that folder
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
    """The clip with a true rate and its numbers; no piece where the reader or the rate rejects it.

    Args:
        rate_is_stated: a person states the rate; physics may doubt it then, but not change it
    """
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
    """How often the file stores each frame."""
    first_frame: int
    """Frame of the file that is the clip's first."""
    time_base: TimeBase | None
    """How the rate was checked; None for a robot, whose gait and size are not a person's."""
    person: Person | None
    """Evidence for the rate, where it is the clip's; None for a robot, and where the rate was wrong."""
    reasons: tuple[Reason, ...]


def correct(read: ReadMotion, *, settings: CatalogSettings, rate_is_stated: bool = False) -> Corrected:
    """Each frame once, then at the rate at which the motion was made."""
    clip, reasons = read.clip, []
    times, first = times_stored(clip, settings.repeated_share)
    if times > 1:
        often = {2: "twice", 3: "three times"}.get(times, f"{times} times")
        text = f"every frame is stored {often}: {clip.fps:g} Hz hold {clip.fps / times:g} Hz; one of each is kept"
        reasons.append(Reason(code="doubled_frames", text=text, effect="repaired", value=float(times), limit=1.0))
        clip = each_once(clip, times, first)
    time_base = person = None
    if isinstance(clip, HumanClip):
        person = bridged(clip, settings)
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


def _too_little_recorded(
    clip: HumanClip | RobotClip, measured: Mapping[str, Number], settings: CatalogSettings
) -> tuple[Reason, ...]:
    """The reason why a file can't be evaluated; none for a file that can."""
    share, least = float(measured["recorded_share"] or 0.0), settings.least_recorded_share
    if share >= least:
        return ()
    if measured["speed_mean"] is None:
        seen = f"of {clip.frame_count} frames none is in a stretch of {settings.velocity_s:g} s that tells a speed"
    else:
        seen = f"where a speed can be measured {share:.0%} of the frames were recorded, at least {least:.0%} are needed"
    text = f"{seen}; root or hips are missing in the others"
    return (Reason(code="too_little_recorded", text=text, effect="rejected", value=share, limit=least),)


def _contradicted(clip: HumanClip | RobotClip, time_base: TimeBase, rate_is_stated: bool) -> Reason:
    """The reason of a contradicted rate and what follows from it."""
    seen = " and ".join(clock.text for clock in (time_base.gravity, time_base.gait) if clock is not None)
    text = f"at {clip.fps:g} Hz {seen}"
    if rate_is_stated:
        effect, then = "noted", "the rate is stated in data/sources.yaml and stays"
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
