"""Criteria of single joints: position limits, speed, acceleration."""

from __future__ import annotations

import numpy as np

from pipeline.feasibility.motion import Motion
from pipeline.feasibility.over_limit import over_limit
from pipeline.feasibility.settings import JointSettings
from pipeline.feasibility.verdict import Verdict
from pipeline.quality.smoothness import acceleration_p99


def joint_limits(motion: Motion, settings: JointSettings) -> Verdict:
    """How far any joint lies beyond its position limits."""
    robot, pos = motion.robot, motion.clip.joint_pos
    excess = np.maximum(robot.joint_lower - pos, pos - robot.joint_upper)
    frame, joint = np.unravel_index(np.argmax(excess), excess.shape)
    value = max(float(excess[frame, joint]), 0.0)
    return Verdict(
        code="joint_limit_excess",
        value=value,
        limit=settings.limit_excess,
        unit="rad",
        text=f"frame {frame}: {robot.joint_names[joint]} is at {pos[frame, joint]:.2f} rad, {value:.2f} past its limit",
        bad=np.any(excess > settings.limit_excess, axis=1),
    )


def joint_speeds(motion: Motion, settings: JointSettings) -> tuple[Verdict, Verdict, Verdict]:
    """Speed over the motors' limits: the largest, and how often and how long a joint is well above.

    A limb swings past its motor's speed for a moment, driven by the others; no motor keeps it there.
    """
    robot, names = motion.robot, motion.robot.joint_names
    speed = np.abs(motion.clip.joint_vel())
    ratio = speed / robot.motor_speed_limit
    frame, joint = np.unravel_index(np.argmax(ratio), ratio.shape)
    limit = robot.motor_speed_limit[joint]
    found = over_limit(ratio > settings.speed_over, motion)
    most, largest = found.worst, motion.largest_share(settings.speed_over_share)
    return (
        Verdict(
            code="joint_speed_ratio",
            value=float(ratio[frame, joint]),
            limit=settings.speed_ratio,
            unit="of the motor's limit",
            text=f"frame {frame}: {names[joint]} moves at {speed[frame, joint]:.1f} rad/s, its motor's limit "
            f"is {limit:.1f}",
            bad=np.any(ratio > settings.speed_ratio, axis=1),
        ),
        Verdict(
            code="joint_speed_over_share",
            value=float(found.share[most]),
            limit=largest,
            unit="of frames",
            text=f"{names[most]} is faster than {settings.speed_over:g} times its motor's limit in "
            f"{100 * found.share[most]:.1f} % of the frames",
            bad=found.frames_of_joints_over(largest),
        ),
        Verdict(
            code="joint_speed_over_run_s",
            value=found.longest_s,
            limit=settings.speed_over_run_s,
            unit="s",
            text=f"from {found.start_s:.2f} s on {names[found.joint]} is faster than {settings.speed_over:g} times its "
            f"motor's limit for {found.longest_s:.2f} s in a row",
            bad=found.frames_of_runs_over(settings.speed_over_run_s),
        ),
    )


def joint_acceleration(motion: Motion, settings: JointSettings, cutoff_hz: float) -> Verdict:
    """99th percentile of joint accelerations: high for shaking and for seams."""
    value = acceleration_p99(motion.clip.joint_pos, motion.clip.fps, cutoff_hz, motion.least_frames)
    return Verdict(
        code="joint_acceleration_p99",
        value=value,
        limit=settings.acceleration_p99,
        unit="rad/s^2",
        text=f"1 % of the joint accelerations are above {value:.0f} rad/s^2",
    )
