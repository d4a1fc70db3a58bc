"""Numbers of a clip as a whole, so that a person sees in a table what a file holds."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series
from pipeline.catalog.gait import Person
from pipeline.catalog.time_base import CatalogSettings
from pipeline.clips.human_clip import FEET, HumanClip
from pipeline.clips.outcome import Number
from pipeline.clips.robot_clip import RobotClip
from pipeline.quality.planar_motion import bridge_positions, planar_motion

MOST_TIMES = 8
"""How often a frame may be stored and still be found."""
NO_STEP = 1e-7
"""Steps up to this [m or rad] are none: the same numbers went through another arithmetic."""
LEAST_MOVED = 0.5
"""Share of the distinct frames that have to differ from the one before: a frozen clip shows no pattern."""
LEAST_SEEN = 0.5
"""Share of the other steps that have to be known: a step beside a missing frame is not known to be none."""


def times_stored(clip: HumanClip | RobotClip, share: float) -> tuple[int, int]:
    """How often each frame is stored, and the file's frame at which the first whole group begins.

    `(1, 0)` for a sound clip, and for one that hardly moves. `share` of all moves have to be in the pattern.
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
    """Every `times`-th frame from `first` on, at the rate that keeps the clip's duration."""
    taken = {name: each[first::times].copy() for name, each in vars(clip).items() if isinstance(each, np.ndarray)}
    return dataclasses.replace(clip, fps=clip.fps / times, **taken)


def _steps(clip: HumanClip | RobotClip) -> Float[np.ndarray, " steps"]:
    """Largest change from each frame to the next: of a person's joint positions [m], of a robot's joints [rad]."""
    if isinstance(clip, HumanClip):
        return rotation.length(np.diff(clip.body_pos_w, axis=0)).max(axis=1)
    return np.abs(np.diff(clip.joint_pos, axis=0)).max(axis=1)


def measure(clip: HumanClip | RobotClip, settings: CatalogSettings, person: Person | None = None) -> dict[str, Number]:
    """Frames, missing frames, speeds [m/s], yaw rates [rad/s]; of a person also gait, legs and feet.

    `recorded_share`: of the frames with a speed, how many were recorded and not bridged.

    Short gaps are bridged first; `person` is `bridged(clip)` if that is known already. None is the value of what
    cannot be measured.
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
    person = person or bridged(clip, settings)
    rate, leg = person.step_rate, person.leg_length
    return {
        **numbers,
        "leg_length": _round(leg) if np.isfinite(leg) else None,
        "cadence_per_min": None if rate is None else _round(60.0 * rate * clip.fps),
        "flight_share": _round(person.flights.frames.sum() / clip.frame_count),
        "stance_foot_speed": _stance_foot_speed(person.clip),
    }


def missing_frames(clip: HumanClip | RobotClip) -> int:
    """Frames in which any number is missing."""
    arrays = [each for each in vars(clip).values() if isinstance(each, np.ndarray) and each.dtype.kind == "f"]
    return int(np.any([~np.isfinite(each.reshape(clip.frame_count, -1)).all(axis=1) for each in arrays], axis=0).sum())


def bridged(clip: HumanClip, settings: CatalogSettings) -> Person:
    """A person's clip with its short gaps bridged, as gait and flights are read from it."""
    return Person(clip=bridge_positions(clip, settings.bridge_s))


def _stance_foot_speed(clip: HumanClip) -> float | None:
    """Mean horizontal speed of the slowest of both ankles and balls [m/s]: skating, once one foot stands."""
    points = np.stack([clip.pos(f"{side}_{part}")[:, :2] for side in FEET for part in ("ankle", "toe")], axis=1)
    slowest = np.linalg.norm(time_series.derivative(points, clip.fps), axis=2).min(axis=1)
    known = slowest[np.isfinite(slowest)]
    return _round(known.mean()) if len(known) else None


def _round(value: float | np.floating) -> float:
    """Four decimals, for a table."""
    return round(float(value), 4)
