"""Reasons: findings and repairs as text and numbers."""

import dataclasses
import itertools
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline import time_series
from pipeline.clips.outcome import Reason
from pipeline.repair.contacts import Contacts
from pipeline.repair.defect import Defect, Findings
from pipeline.repair.floor import Floor
from pipeline.repair.settings import ContactSettings, FloorSettings, RepairSettings
from pipeline.repair.skating import Planted, Skating
from pipeline.repair.tree import FrameMask, Positions

COMEBACK_SPEED = 2.0
"""A gap of the whole body is filled if the speed across it is at most this many times the clip's usual top speed."""
SLACK = 0.05
"""Displacement across a gap that is always allowed [m]."""
CUT = "these frames are cut"


@dataclass(frozen=True, kw_only=True)
class Division:
    """Division of a clip into kept stretches by its defects."""

    dropped: FrameMask
    """Frames that are cut, not filled."""
    filled: FrameMask
    """Frames with filled samples."""
    stretches: tuple[tuple[int, int], ...]
    """Frame ranges without a dropped frame and without a cut inside."""


def divide(pos_w: Positions, findings: Findings, fps: float, settings: RepairSettings) -> Division:
    """Drop gaps that are too long, touch an end of the clip or have an implausible displacement; fill the others."""
    count = findings.frame_count
    lost = findings.lost
    longest = int(np.floor(settings.fill.longest_gap_s * fps + 1e-6))
    dropped = np.zeros(count, dtype=bool)
    for index in np.flatnonzero(lost.any(axis=0)):
        for start, stop in time_series.runs(lost[:, index]):
            if stop - start > longest or start == 0 or stop == count:
                dropped[start:stop] = True
    whole = lost[:, 0]
    good = np.flatnonzero(~whole)
    step = np.linalg.norm(np.diff(pos_w[good, 0], axis=0), axis=1) / np.diff(good)
    top = float(np.percentile(step, 95)) if len(step) else 0.0
    for start, stop in time_series.runs(whole & ~dropped):
        way = np.linalg.norm(pos_w[stop, 0] - pos_w[start - 1, 0])
        if way > COMEBACK_SPEED * top * (stop - start + 1) + SLACK:
            dropped[start:stop] = True
    edges = sorted({0, count, *findings.cuts})
    stretches = [
        (low + start, low + stop)
        for low, high in itertools.pairwise(edges)
        for start, stop in time_series.runs(~dropped[low:high])
    ]
    return Division(dropped=dropped, filled=lost.any(axis=1) & ~dropped, stretches=tuple(stretches))


MOST_OF_A_KIND = 20
"""More defects of one kind than this are reported as one reason."""


def of_defects(
    findings: Findings, division: Division, start: int, stop: int, fps: float, settings: RepairSettings
) -> list[Reason]:
    """A reason for each defect that touches the window [start, stop)."""
    touching = [one for one in findings.defects if one.start < stop and max(one.stop, one.start + 1) > start]
    merged = list(_merged(touching))
    gathered = []
    for code in dict.fromkeys(one.code for one in merged):
        alike = [one for one in merged if one.code == code]
        if len(alike) > MOST_OF_A_KIND:
            gathered.append(_summary(alike, division, fps))
        else:
            gathered += [_reason(one, division, fps, settings) for one in alike]
    return gathered


def of_floor(floor: Floor, settings: FloorSettings) -> list[Reason]:
    """Reasons for a ground height other than 0 and for ground drift."""
    gathered: list[Reason] = []
    numbers: dict[str, Any] = {"effect": "repaired", "unit": "m"}
    if abs(floor.height) > settings.offset_limit:
        text, limit = f"the ground is at z = {floor.height:+.3f} m; the clip is moved onto z = 0", settings.offset_limit
        gathered.append(Reason(code="floor_offset", text=text, value=floor.height, limit=limit, **numbers))
    if floor.slope_m_s != 0.0:
        text = f"the ground is {floor.drift:+.3f} m higher at the clip's end than at its beginning; that is taken out"
        gathered.append(Reason(code="floor_drift", text=text, value=floor.drift, limit=settings.drift_limit, **numbers))
    return gathered


def of_slip(
    slip: float, speed_m_s: float, frames: tuple[int, int], fps: float, settings: ContactSettings
) -> list[Reason]:
    """Reason for a mean slip of a piece [first, last) above the limit for its mean pelvis speed."""
    limit = settings.slip_limit_m_s + settings.slip_per_speed * speed_m_s
    if slip <= limit:
        return []
    text = f"standing feet slide at {slip:.3f} m/s on average, allowed are {limit:.3f} m/s"
    return [refused("foot_skate", text, frames, fps, slip, limit, "m/s")]


def of_skating(one: Skating, fps: float, settings: ContactSettings) -> Reason:
    """Reason for a stretch in which the supporting foot slides."""
    speed_m_s, limit = one.speed_m_s, settings.skate_limit_m_s
    text = f"standing feet slide at {speed_m_s:.3f} m/s, allowed are {limit:g} m/s; {CUT}"
    return refused("foot_skate", text, (one.start, one.stop), fps, speed_m_s, limit, "m/s")


def of_planting(found: Planted, first: int, last: int, fps: float, settings: ContactSettings) -> Reason:
    """Reason that states that slowly sliding feet of a stretch [first, last) were planted."""
    text = (
        f"frames {first}-{last - 1}: standing feet slide; the body is moved so that they stand, at "
        f"{found.mean_m_s:.3f} m/s on average, {found.way_m:.2f} m in all"
    )
    numbers = {"value": found.mean_m_s, "limit": settings.plant_m_s, "unit": "m/s"}
    return Reason.of_frames("foot_skate", text, "repaired", (first, last), fps, **numbers)


def of_flight(contacts: Contacts, frames: tuple[int, int], fps: float, settings: ContactSettings) -> list[Reason]:
    """Reason for a flight phase in a piece [first, last) that is too long for a person."""
    flights = time_series.runs(np.all(~contacts, axis=1))
    longest = max((stop - start for start, stop in flights), default=0) / fps
    if longest <= settings.longest_flight_s:
        return []
    text = f"no foot is on the ground for {longest:.2f} s, allowed are {settings.longest_flight_s:g} s"
    return [refused("no_contact", text, frames, fps, longest, settings.longest_flight_s, "s")]


def too_short(first: int, last: int, fps: float, min_seconds: float) -> Reason:
    """Reason for a stretch between defects that is too short."""
    seconds = (last - first) / fps
    text = f"{seconds:.2f} s are left, at least {min_seconds:g} s are needed"
    return refused("too_short", text, (first, last), fps, seconds, min_seconds, "s")


def refused(
    code: str,
    text: str,
    frames: tuple[int, int],
    fps: float,
    value: float | None = None,
    limit: float | None = None,
    unit: str = "",
) -> Reason:
    """Reason for a rejected stretch of frames [first, last)."""
    text = f"frames {frames[0]}-{frames[1] - 1}: {text}"
    return Reason.of_frames(code, text, "rejected", frames, fps, value=value, limit=limit, unit=unit)


def _merged(defects: list[Defect]) -> Iterable[Defect]:
    """Merge defects of one kind at the same frames."""
    groups: dict[tuple[str, int, int], list[Defect]] = defaultdict(list)
    for one in defects:
        groups[one.code, one.start, one.stop].append(one)
    for group in sorted(groups.values(), key=lambda group: (group[0].start, group[0].stop)):
        worst = max(group, key=lambda one: one.value or 0.0)
        more = len({body for one in group for body in one.bodies} - set(worst.bodies))
        text = worst.text + (f" (and {more} more joints)" if more else "")
        yield dataclasses.replace(worst, text=text)


def _reason(one: Defect, division: Division, fps: float, settings: RepairSettings) -> Reason:
    if one.code == "swapped_sides":
        return one.reason(fps, "repaired", "put right")
    if one.is_cut:
        return one.reason(fps, "repaired", "the clip is cut there")
    if division.dropped[one.start : one.stop].all():
        return one.reason(fps, "rejected", CUT)
    seconds = (one.stop - one.start) / fps
    if seconds > settings.fill.short_gap_s + 1e-9:
        return one.reason(fps, "repaired", f"filled over {seconds:.2f} s, an estimate")
    return one.reason(fps, "repaired", "filled")


def _summary(alike: list[Defect], division: Division, fps: float) -> Reason:
    frames = sorted({frame for one in alike for frame in range(one.start, max(one.stop, one.start + 1))})
    cut = int(division.dropped[frames].sum())
    first, last = alike[0], alike[-1]
    text = (
        f"{len(alike)} times between frames {frames[0]} and {frames[-1]}, first: {first.text}; "
        f"{len(frames) - cut} frames filled, {cut} cut"
    )
    effect = "rejected" if cut == len(frames) else "repaired"
    return Reason.of_frames(first.code, text, effect, (first.start, last.stop), fps, value=float(len(alike)))
