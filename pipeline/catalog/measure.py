"""Numbers of a clip as a whole, so that a person sees in a table what a file holds."""

from __future__ import annotations

import numpy as np

from pipeline import time_series
from pipeline.catalog.flight import Person
from pipeline.catalog.settings import CatalogSettings
from pipeline.clips.human_clip import FEET, HumanClip
from pipeline.clips.outcome import Number
from pipeline.clips.robot_clip import RobotClip
from pipeline.quality.gap_bridge import bridge_positions
from pipeline.quality.planar_motion import planar_motion


def measure(clip: HumanClip | RobotClip, settings: CatalogSettings, person: Person | None = None) -> dict[str, Number]:
    """Frames, missing frames, speeds [m/s], yaw rates [rad/s]; of a person also gait, legs and feet.

    `recorded_share`: of the frames with a speed, how many were recorded and not bridged.

    Short gaps are bridged first; `person` is `bridged(clip)` where that was looked at before. None stands for what
    cannot be measured.
    """
    motion = planar_motion(clip, settings.velocity_s, settings.facing_s, settings.bridge_s)
    speed, yaw_rate = motion.speed[motion.valid], motion.yaw_rate[motion.valid]
    numbers: dict[str, Number] = {
        "frames": clip.frame_count,
        "missing_frames": int(_missing(clip).sum()),
        "recorded_share": _round(motion.recorded[motion.valid].mean()) if len(speed) else 0.0,
        "speed_mean": _round(speed.mean()) if len(speed) else None,
        "speed_max": _round(speed.max()) if len(speed) else None,
        "yaw_rate_mean": _round(yaw_rate.mean()) if len(speed) else None,
        "yaw_rate_max": _round(np.abs(yaw_rate).max()) if len(speed) else None,
    }
    if not isinstance(clip, HumanClip):
        return numbers
    return {**numbers, **_of_person(person or bridged(clip, settings))}


def bridged(clip: HumanClip, settings: CatalogSettings) -> Person:
    """A person's clip with its short gaps bridged, as gait and flights are read from it."""
    return Person(clip=bridge_positions(clip, settings.bridge_s))


def _missing(clip: HumanClip | RobotClip) -> np.ndarray:
    """Frames (t,) in which any number is missing."""
    if isinstance(clip, HumanClip):
        arrays = (clip.body_pos_w, clip.body_quat_w)
    else:
        arrays = (clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    return np.any([~np.isfinite(each.reshape(clip.frame_count, -1)).all(axis=1) for each in arrays], axis=0)


def _of_person(person: Person) -> dict[str, Number]:
    clip = person.clip
    rate, leg = person.step_rate, person.leg_length
    return {
        "leg_length": _round(leg) if np.isfinite(leg) else None,
        "cadence_per_min": None if rate is None else _round(60.0 * rate * clip.fps),
        "flight_share": _round(person.flights.frames.sum() / clip.frame_count),
        "stance_foot_speed": _stance_foot_speed(clip),
    }


def _stance_foot_speed(clip: HumanClip) -> float | None:
    """Mean horizontal speed of the slowest of both ankles and balls [m/s]: skating, once one foot stands."""
    points = np.stack([clip.pos(f"{side}_{part}")[:, :2] for side in FEET for part in ("ankle", "toe")], axis=1)
    slowest = np.linalg.norm(time_series.derivative(points, clip.fps), axis=2).min(axis=1)
    known = slowest[np.isfinite(slowest)]
    return _round(known.mean()) if len(known) else None


def _round(value: float | np.floating) -> float:
    """Four decimals, as many as a table can bear."""
    return round(float(value), 4)
