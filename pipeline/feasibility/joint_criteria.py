"""Criteria of single joints: position limits, speed, acceleration."""

from __future__ import annotations

import numpy as np

from pipeline.feasibility.motion import Motion
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


def joint_speeds(motion: Motion, settings: JointSettings) -> Verdict:
    """Speed of any joint over its motor's limit."""
    robot = motion.robot
    speed = np.abs(motion.clip.joint_vel())
    ratio = speed / robot.motor_speed_limit
    frame, joint = np.unravel_index(np.argmax(ratio), ratio.shape)
    limit = robot.motor_speed_limit[joint]
    return Verdict(
        code="joint_speed_ratio",
        value=float(ratio[frame, joint]),
        limit=settings.speed_ratio,
        unit="of the motor's limit",
        text=f"frame {frame}: {robot.joint_names[joint]} moves at {speed[frame, joint]:.1f} rad/s, its motor's limit "
        f"is {limit:.1f}",
        bad=np.any(ratio > settings.speed_ratio, axis=1),
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
