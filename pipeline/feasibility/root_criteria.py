"""Criteria of the root link: height, tilt, speeds, acceleration, jerk. All on the low-passed root."""

from __future__ import annotations

import numpy as np

from pipeline import rotation, time_series
from pipeline.feasibility.motion import Motion
from pipeline.feasibility.settings import RootSettings
from pipeline.feasibility.verdict import Verdict
from pipeline.quality.smoothness import mean_jerk


def root_height(motion: Motion, settings: RootSettings) -> tuple[Verdict, Verdict]:
    """Lowest and highest root over the default height."""
    ratio = motion.smooth_root_pos_w[:, 2] / motion.robot.default_root_height
    low, high = settings.height
    name = motion.robot.root_link
    lowest = f"frame {int(np.argmin(ratio))}: the {name} is at {ratio.min():.2f} of its standing height"
    highest = f"frame {int(np.argmax(ratio))}: the {name} is at {ratio.max():.2f} of its standing height"
    unit = "of the standing height"
    return (
        Verdict(
            code="root_height_min",
            value=float(ratio.min()),
            limit=low,
            lower=True,
            text=lowest,
            bad=ratio < low,
            unit=unit,
        ),
        Verdict(
            code="root_height_max", value=float(ratio.max()), limit=high, text=highest, bad=ratio > high, unit=unit
        ),
    )


def root_tilt(motion: Motion, settings: RootSettings) -> Verdict:
    """Angle between the root's z axis and the vertical."""
    up_w = rotation.rotate(motion.smooth_root_quat_w, np.array([0.0, 0.0, 1.0]))
    tilt_deg = np.degrees(np.arccos(np.clip(up_w[:, 2], -1.0, 1.0)))
    return _peak("root_tilt_deg", tilt_deg, settings.tilt_deg, "deg", "is tilted by {:.0f} deg", motion)


def root_speeds(motion: Motion, settings: RootSettings) -> tuple[Verdict, Verdict, Verdict]:
    """Speed, angular speed and acceleration: a jump of the root shows in all of them."""
    fps = motion.clip.fps
    velocity = time_series.derivative(motion.smooth_root_pos_w, fps)
    speed = np.linalg.norm(velocity, axis=1)
    turning = np.linalg.norm(rotation.angular_velocity_w(motion.smooth_root_quat_w, fps), axis=1)
    acceleration = np.linalg.norm(time_series.derivative(velocity, fps), axis=1)
    return (
        _peak("root_speed", speed, settings.speed, "m/s", "moves at {:.1f} m/s", motion),
        _peak("root_turn_speed", turning, settings.turn_speed, "rad/s", "turns at {:.1f} rad/s", motion),
        _peak(
            "root_acceleration", acceleration, settings.acceleration, "m/s^2", "is accelerated at {:.0f} m/s^2", motion
        ),
    )


def root_jerk(motion: Motion, settings: RootSettings) -> Verdict:
    """Mean jerk of the root."""
    value = mean_jerk(motion.clip.root_pos_w, motion.clip.fps, settings.cutoff_hz)
    return Verdict(
        code="root_jerk",
        value=value,
        limit=settings.jerk,
        unit="m/s^3",
        text=f"the mean jerk of the {motion.robot.root_link} is {value:.0f} m/s^3",
    )


def _peak(code: str, values: np.ndarray, limit: float, unit: str, does: str, motion: Motion) -> Verdict:
    frame = int(np.argmax(values))
    text = f"frame {frame}: the {motion.robot.root_link} {does.format(values[frame])}"
    return Verdict(code=code, value=float(values[frame]), limit=limit, unit=unit, text=text, bad=values > limit)
