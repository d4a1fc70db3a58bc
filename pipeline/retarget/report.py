"""The numbers a retargeted clip carries on: the scorer's figures, its scale and the command that it is."""

from __future__ import annotations

import math

from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.quality.command_velocity import command_velocity
from pipeline.robot import Robot
from pipeline.scoring import score_without_collisions, worst_of_bars


def numbers_of(clip: RobotClip, human: HumanClip, leg_ratio: float, robot: Robot) -> dict[str, float | str | None]:
    """Numbers by name; `human` is the clip at the robot's rate.

    The velocities are the robot's: a human's times `leg_ratio`. Slip, drift and depth are by the scorer's own labels
    of standing feet, `slip_m_s` by the middle ones. Self-collision is KP5's to find. None where a clip has no sample
    (no foot ever stands). `worst_figure` is the one that is furthest over its bar, `times_its_bar` by how much.
    """
    figures = score_without_collisions(human, clip, robot).figures()
    worst, times = worst_of_bars(figures, clip.fps)
    numbers = {
        "slip_m_s": figures["slip_middle_m_s"],
        "slip_strict_m_s": figures["slip_strict_m_s"],
        "drift_m": figures["drift_cm"] / 100.0,
        "penetration_m": figures["penetration_max_cm"] / 100.0,
        "height_shift_m": figures["height_shift_mm"] / 1000.0,
        "jerk_rad_s3": figures["jerk_rad_s3"],
        "jump_percent": figures["jump_percent"],
        **{key: value for key, value in figures.items() if key.endswith("_error_deg")},
    }
    known = {name: value if math.isfinite(value) else None for name, value in numbers.items()}
    return {"leg_ratio": leg_ratio, **known, "worst_figure": worst, "times_its_bar": times, **velocity_of(clip)}


def velocity_of(clip: RobotClip) -> dict[str, float]:
    """The command that the robot's motion is: mean forward and lateral velocity [m/s], yaw rate [rad/s]."""
    return dict(vars(command_velocity(clip.root_pos_w, clip.root_quat_w, clip.fps)))
