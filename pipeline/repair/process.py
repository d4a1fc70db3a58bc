"""KP2 for one window of a clip: find, fill and cut defects, place and low-pass the pieces, label and check contacts."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from pipeline import time_series
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Numbers, Outcome, Piece, Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.repair import reasons
from pipeline.repair.contacts import Feet, both_feet, label_contacts, stance_slip
from pipeline.repair.defect import Findings
from pipeline.repair.detect import detect
from pipeline.repair.fill import filled, smoothed
from pipeline.repair.floor import Floor, find_floor, levelled, place
from pipeline.repair.reasons import Division, divide
from pipeline.repair.robot_motion import process_robot
from pipeline.repair.settings import RepairSettings
from pipeline.repair.skating import Planted, Skating, find_skating, planted
from pipeline.repair.tree import Positions
from pipeline.robot import Robot

CONTEXT_S = 1.0
"""Motion before and after a window that is used for the filters and contacts [s]."""


@dataclass(frozen=True, kw_only=True)
class WholeClip:
    """Intermediate results that all windows of a source clip share."""

    repaired: HumanClip
    """The whole clip, filled and without ground drift."""
    findings: Findings
    division: Division
    floor: Floor


def prepare(clip: HumanClip | RobotClip, *, settings: RepairSettings) -> WholeClip | None:
    """Defects, stretches and floor of a source clip; None for a robot's recording, which is processed per window."""
    if isinstance(clip, RobotClip):
        return None
    mended, findings = detect(clip, settings.detection)
    division = divide(mended.body_pos_w, findings, clip.fps, settings)
    repaired = filled(mended, findings, division.dropped, settings.fill)
    sound = ~findings.lost.any(axis=1) & ~division.dropped
    floor = find_floor(repaired, settings.floor, sound, findings, mended)
    return WholeClip(repaired=levelled(repaired, floor), findings=findings, division=division, floor=floor)


def process(
    clip: HumanClip | RobotClip,
    numbers: Numbers,
    *,
    settings: RepairSettings,
    robot: Robot | None = None,
    prepared: WholeClip | None = None,
) -> Outcome:
    """Repair the window [`start_frame`, `stop_frame`) of `clip`; the Outcome has one or more pieces.

    `clip` is the whole source clip, so that the filters and detectors have context; without these two numbers the
    window is the whole clip. Times in reasons refer to the source clip. Raises ClipError if the window is not in the
    clip.
    """
    start, stop = window_of(clip.name, clip.frame_count, numbers)
    if isinstance(clip, RobotClip):
        return process_robot(clip, start, stop, settings=settings, robot=robot)
    whole = prepared or prepare(clip, settings=settings)
    assert whole is not None
    division, floor = whole.division, whole.floor
    gathered = reasons.of_defects(whole.findings, division, start, stop, clip.fps, settings)
    gathered += reasons.of_floor(floor, settings.floor)
    repaired = dataclasses.replace(whole.repaired, name=clip.name)
    pieces, more = _pieces(repaired, start, stop, str(numbers.get("skill") or ""), division, floor, settings)
    inside = slice(start, stop)
    return Outcome(
        pieces=pieces,
        reasons=tuple(gathered + more),
        numbers={
            "floor_m": floor.height,
            "floor_drift_m": floor.drift,
            "filled_frames": int(division.filled[inside].sum()),
            "cut_frames": stop - start - sum(piece.clip.frame_count for piece in pieces),
            "defects": len(gathered),
        },
    )


def window_of(name: str, frame_count: int, numbers: Numbers) -> tuple[int, int]:
    """The window's frames [start, stop). Raises ClipError if they are not in the clip."""
    start, stop = int(numbers.get("start_frame") or 0), int(numbers.get("stop_frame") or frame_count)
    if not 0 <= start < stop <= frame_count:
        raise ClipError(name, "window", f"the window is [{start}, {stop}), the clip has {frame_count} frames")
    return start, stop


def _pieces(
    clip: HumanClip, start: int, stop: int, skill: str, division: Division, floor: Floor, settings: RepairSettings
) -> tuple[tuple[Piece, ...], list[Reason]]:
    """The pieces of the window that are kept, and the reasons for the others."""
    context = round(CONTEXT_S * clip.fps)
    gathered, taken = [], []
    for begin, end in division.stretches:
        first, last = max(begin, start), min(end, stop)
        low, high = max(begin, start - context), min(end, stop + context)
        if first >= last:
            continue
        if (last - first) / clip.fps < settings.min_seconds:
            gathered.append(reasons.too_short(first, last, clip.fps, settings.min_seconds))
            continue
        labelled = smoothed(clip.cut(low, high, clip.name), skill, settings.smooth)
        feet = both_feet(labelled, floor.height)
        labelled = dataclasses.replace(labelled, contacts=label_contacts(feet, clip.fps, settings.contact))
        pos_w = clip.body_pos_w[low:high]
        skating = _inside(find_skating(feet, pos_w, clip.fps, settings.contact), low, first, last)
        begun = min((one.start for one in skating), default=first)
        ended = max((one.stop for one in skating), default=last)
        sliding, whole = slice(begun - low, ended - low), slice(first - low, last - low)
        fixed = _planted(labelled, pos_w, feet, skating, (sliding, whole), floor, settings)
        if fixed is not None:
            labelled, feet, skating = fixed.clip, both_feet(fixed.clip, floor.height), []
            gathered.append(reasons.of_planting(fixed, begun, ended, clip.fps, settings.contact))
        gathered += [reasons.of_skating(one, clip.fps, settings.contact) for one in skating]
        for low_kept, high_kept in _between(skating, first, last):
            refused, piece = _piece(labelled, feet, low_kept, high_kept, low, settings)
            gathered += refused
            if piece is not None:
                taken.append((low_kept, *piece, fixed))
    pieces = []
    for number, (first, piece, slip, fixed) in enumerate(taken, start=1):
        named = dataclasses.replace(piece, name=f"{clip.name}+{number}" if len(taken) > 1 else clip.name)
        placed = _placed(named, first, slip, division, floor, floor.at(first, clip), settings)
        planting = {"planted_m_s": fixed.mean_m_s if fixed else 0.0, "planted_m": fixed.way_m if fixed else 0.0}
        pieces.append(dataclasses.replace(placed, numbers={**placed.numbers, **planting}))
    return tuple(pieces), gathered


def _planted(
    labelled: HumanClip,
    pos_w: Positions,
    feet: Feet,
    skating: list[Skating],
    spans: tuple[slice, slice],
    floor: Floor,
    settings: RepairSettings,
) -> Planted | None:
    """Plant the feet where they slide slowly; None if they do not slide or still slide afterwards.

    Args:
        labelled: the stretch with its context, with contacts
        pos_w: body positions before the low pass [m]
        skating: stretches in which the feet slide
        spans: frames in which the feet slide, and frames of the whole stretch
    """
    contact, fps = settings.contact, labelled.fps
    sliding, within = spans
    assert labelled.contacts is not None

    def too_fast(clip: HumanClip, feet: Feet, limit_m_s: float) -> bool:
        assert clip.contacts is not None
        slip = stance_slip((feet[0].cut(within), feet[1].cut(within)), clip.contacts[within])
        return slip > limit_m_s + contact.slip_per_speed * _ground_speed(clip.pos("pelvis")[within], fps)

    slides = skating or too_fast(labelled, feet, contact.slip_limit_m_s)
    fast = any(one.speed_m_s > contact.plant_m_s for one in skating) or too_fast(labelled, feet, contact.plant_m_s)
    if not slides or fast:
        return None
    found = planted(labelled, feet, labelled.contacts, sliding, contact.plant_m_s)
    moved_w = found.clip.body_pos_w[:, :1] - labelled.body_pos_w[:, :1]
    after = both_feet(found.clip, floor.height)
    labels = label_contacts(after, fps, contact)  # sliding feet have a higher speed limit than standing feet
    found = dataclasses.replace(found, clip=dataclasses.replace(found.clip, contacts=labels))
    still = find_skating(after, pos_w + moved_w, fps, contact)
    if too_fast(found.clip, after, contact.slip_limit_m_s) or _inside(still, 0, within.start, within.stop):
        return None
    return found


def _piece(
    labelled: HumanClip, feet: Feet, start: int, stop: int, low: int, settings: RepairSettings
) -> tuple[list[Reason], tuple[HumanClip, float] | None]:
    """Frames [start, stop) of the source and their slip, or reasons against them; `labelled` begins at `low`."""
    part, fps = slice(start - low, stop - low), labelled.fps
    assert labelled.contacts is not None
    if (stop - start) / fps < settings.min_seconds:
        return [reasons.too_short(start, stop, fps, settings.min_seconds)], None
    slip = stance_slip((feet[0].cut(part), feet[1].cut(part)), labelled.contacts[part])
    speed_m_s = _ground_speed(labelled.pos("pelvis")[part], fps)
    gathered = reasons.of_slip(slip, speed_m_s, (start, stop), fps, settings.contact)
    gathered += reasons.of_flight(labelled.contacts[part], (start, stop), fps, settings.contact)
    return gathered, None if gathered else (labelled.cut(part.start, part.stop, labelled.name), slip)


def _inside(skating: list[Skating], low: int, first: int, last: int) -> list[Skating]:
    """Convert stretches relative to frame `low` to frames of the source, clipped to [first, last)."""
    moved = [
        dataclasses.replace(one, start=max(one.start + low, first), stop=min(one.stop + low, last)) for one in skating
    ]
    return [one for one in moved if one.stop > one.start]


def _between(skating: list[Skating], first: int, last: int) -> list[tuple[int, int]]:
    """Parts of [first, last) outside the sliding stretches."""
    edges = [first, *(edge for one in skating for edge in (one.start, one.stop)), last]
    return [(start, stop) for start, stop in zip(edges[::2], edges[1::2], strict=True) if stop > start]


def _ground_speed(pos_w: np.ndarray, fps: float) -> float:
    """Mean horizontal speed [m/s] of a point (t, 3)."""
    return float(np.linalg.norm(time_series.derivative(pos_w[:, :2], fps), axis=1).mean())


def _placed(
    clip: HumanClip,
    first: int,
    slip: float,
    division: Division,
    floor: Floor,
    source_floor_m: float,
    settings: RepairSettings,
) -> Piece:
    placement = place(clip, floor.height, settings.heading_s)
    placed = placement.applied(clip)
    assert placed.contacts is not None
    numbers = {
        "seconds": clip.duration_s,
        "start_frame": first,
        "stop_frame": first + clip.frame_count,
        **dataclasses.asdict(dataclasses.replace(placement, floor_m=source_floor_m, floor_slope_m_s=floor.slope_m_s)),
        "filled_frames": int(division.filled[first : first + clip.frame_count].sum()),
        "stance_slip_m_s": slip,
        "contact_share_left": float(placed.contacts[:, 0].mean()),
        "contact_share_right": float(placed.contacts[:, 1].mean()),
        "flight_share": float((~placed.contacts.any(axis=1)).mean()),
    }
    return Piece(clip=placed, numbers=numbers)
