"""Criteria on joints: position limits, speed, acceleration."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pipeline.feasibility.criterion import (
    NOTHING,
    Criterion,
    RatioToMotorLimit,
    Seconds,
    ShareOfFrames,
    Verdict,
    criterion,
)
from pipeline.feasibility.motion import Motion
from pipeline.feasibility.over_time import share_and_run
from pipeline.files.ranges import POSITIVE, Range
from pipeline.files.sourced import Unit
from pipeline.quality.retargeting import acceleration_p99

LIMITS = "joint and speed limits"


@dataclass(frozen=True, kw_only=True)
class JointSettings:
    """Limits for positions, speeds and accelerations of joints."""

    limit_excess: Annotated[float, Range(0.0, 1.0), Unit("rad")]
    """Largest violation of the robot's position limits [rad]."""
    speed_ratio: RatioToMotorLimit
    """Largest ratio of joint speed to the motor's limit."""
    speed_over: RatioToMotorLimit
    """Ratio to the motor's limit above which a joint counts as well over its limit."""
    speed_over_share: ShareOfFrames
    """Largest share of a joint's frames above that ratio."""
    speed_over_run_s: Seconds
    """Longest uninterrupted time above that ratio [s]."""
    acceleration_p99: Annotated[float, POSITIVE, Unit("rad/s^2")]
    """Largest 99th percentile of low-passed joint accelerations over all frames and joints [rad/s^2]."""


@criterion(
    Criterion(
        "joint_limit_excess", LIMITS, "joints.limit_excess", "rad", "largest excess of a joint over its position limits"
    )
)
def joint_limits(motion: Motion, settings: JointSettings) -> tuple[Verdict, ...]:
    """Largest violation of a position limit over all joints."""
    robot, pos = motion.robot, motion.clip.joint_pos
    excess = np.maximum(robot.joint_lower - pos, pos - robot.joint_upper)
    frame, joint = np.unravel_index(np.argmax(excess), excess.shape)
    value = max(float(excess[frame, joint]), 0.0)
    verdict = Verdict(
        code="joint_limit_excess",
        value=value,
        limit=settings.limit_excess,
        text=f"frame {frame}: {robot.joint_names[joint]} is at {pos[frame, joint]:.2f} rad, {value:.2f} past its limit",
        bad=np.any(excess > settings.limit_excess, axis=1),
    )
    return (verdict,)


@criterion(
    Criterion(
        "joint_speed_ratio",
        LIMITS,
        "joints.speed_ratio",
        "of the motor's limit",
        "largest joint speed as a share of the motor's limit",
    ),
    Criterion(
        "joint_speed_over_share",
        LIMITS,
        "joints.speed_over_share",
        "of frames",
        "share of frames above `joints.speed_over` times the motor's speed, worst joint",
    ),
    Criterion("joint_speed_over_run_s", LIMITS, "joints.speed_over_run_s", "s", "longest time above that speed"),
)
def joint_speeds(motion: Motion, settings: JointSettings) -> tuple[Verdict, Verdict, Verdict]:
    """Joint speeds relative to the motors' limits: maximum, share of frames and longest time well above.

    Coupled dynamics can drive a joint beyond its motor's speed for a moment; no motor can sustain it.
    """
    robot = motion.robot
    speed = np.abs(motion.clip.joint_vel())
    ratio = speed / robot.motor_speed_limit
    frame, joint = np.unravel_index(np.argmax(ratio), ratio.shape)
    largest = Verdict(
        code="joint_speed_ratio",
        value=float(ratio[frame, joint]),
        limit=settings.speed_ratio,
        text=f"frame {frame}: {robot.joint_names[joint]} moves at {speed[frame, joint]:.1f} rad/s, its motor's limit "
        f"is {robot.motor_speed_limit[joint]:.1f}",
        bad=np.any(ratio > settings.speed_ratio, axis=1),
    )
    over = f"{{joint}} is faster than {settings.speed_over:g} times its motor's limit"
    share, run = share_and_run(
        ("joint_speed_over_share", "joint_speed_over_run_s"),
        ratio > settings.speed_over,
        (settings.speed_over_share, settings.speed_over_run_s),
        motion,
        (
            f"{over} in {{percent:.1f}} % of the frames",
            f"from {{start_s:.2f}} s on {over} for {{run_s:.2f}} s in a row",
        ),
    )
    return largest, share, run


@criterion(
    Criterion(
        "joint_acceleration_p99",
        "smoothness",
        "joints.acceleration_p99",
        "rad/s^2",
        "99th percentile of joint accelerations, low-passed at `root.cutoff_hz`",
        cuts=NOTHING,
    )
)
def joint_acceleration(motion: Motion, settings: JointSettings) -> tuple[Verdict, ...]:
    """99th percentile of joint accelerations, which is high for shaking and for discontinuities."""
    value = acceleration_p99(motion.smooth_joint_pos, motion.clip.fps, motion.least_frames)
    verdict = Verdict(
        code="joint_acceleration_p99",
        value=value,
        limit=settings.acceleration_p99,
        text=f"1 % of the joint accelerations are above {value:.0f} rad/s^2",
    )
    return (verdict,)
