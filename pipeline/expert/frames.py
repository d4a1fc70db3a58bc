"""Database frames of Eq. (1), 79 numbers: root, joints, hands and feet, and their velocities.

    x 3 | R 4 | q 21 | p_ee 12 | v 3 | w 3 | dq 21 | dp_ee 12

Positions are the clip's own. Velocities are central differences of them (one-sided at both ends): dp_ee is
the derivative of the local positions, v and w are the world velocities of the Trunk expressed in the Trunk
frame. So each velocity can be recomputed from the positions.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.robot import Kinematics, Robot

FPS = 50.0
"""Rate of the database [Hz]: one frame per control step of 0.02 s."""

POSITION_DECIMALS = 6
"""Decimals of positions: 1 um or 1 urad. Velocities recomputed from rounded positions are then accurate to 5e-5."""

QUATERNION_DECIMALS = 8
"""Decimals of quaternions; keeps the norm of a rounded quaternion within 2e-8 of 1."""

VELOCITY_DECIMALS = 5
"""Decimals of velocities: 1e-5 m/s or rad/s, below the error from rounded positions."""


@dataclass(frozen=True, kw_only=True)
class Column:
    """Description of one number of a frame."""

    name: str
    unit: str
    frame: str
    """`world` (z up, ground at z = 0), the root link's name (its own frame) or `joint`."""


def columns(robot: Robot) -> tuple[Column, ...]:
    """The columns of a frame of `robot` in order."""
    root = robot.root_link
    ends = [f"{site}_{axis}" for site in (*robot.hands, *robot.feet) for axis in "xyz"]
    groups = [
        ([f"root_pos_{axis}" for axis in "xyz"], "m", "world"),
        ([f"root_quat_{part}" for part in "wxyz"], "1", "world"),
        ([f"{joint}_pos" for joint in robot.controlled], "rad", "joint"),
        ([f"{end}_pos" for end in ends], "m", root),
        ([f"root_lin_vel_{axis}" for axis in "xyz"], "m/s", root),
        ([f"root_ang_vel_{axis}" for axis in "xyz"], "rad/s", root),
        ([f"{joint}_vel" for joint in robot.controlled], "rad/s", "joint"),
        ([f"{end}_vel" for end in ends], "m/s", root),
    ]
    return tuple(Column(name=name, unit=unit, frame=frame) for names, unit, frame in groups for name in names)


def expert_frames(clip: RobotClip, robot: Robot) -> Float[np.ndarray, "t c"]:
    """Frames of a 50 Hz clip in the order of `columns(robot)`, not rounded.

    Raises ClipError for another rate, for other joints than the robot's and for fewer than two frames.
    """
    return next(frames_of_clips([clip], robot))


def frames_of_clips(clips: Sequence[RobotClip], robot: Robot) -> Iterator[Float[np.ndarray, "t c"]]:
    """`expert_frames` of each clip; the kinematics of all are computed together."""
    for clip in clips:
        _check(clip, robot)
    if not clips:
        return
    ends = np.cumsum([clip.frame_count for clip in clips])[:-1]
    ends_b = np.split(_end_effectors_b(np.concatenate([clip.joint_pos for clip in clips]), robot), ends)
    for clip, own in zip(clips, ends_b, strict=True):
        yield _frames(clip, own, robot)


def _frames(clip: RobotClip, ends_b: Float[np.ndarray, "t 12"], robot: Robot) -> Float[np.ndarray, "t c"]:
    controlled = [robot.joint_names.index(name) for name in robot.controlled]
    joints = clip.joint_pos[:, controlled]
    lin_vel_b = rotation.rotate_inverse(clip.root_quat_w, clip.root_lin_vel_w())
    ang_vel_b = rotation.rotate_inverse(clip.root_quat_w, clip.root_ang_vel_w())
    joint_vel = time_series.derivative(joints, clip.fps)
    end_vel_b = time_series.derivative(ends_b, clip.fps)
    parts = [clip.root_pos_w, clip.root_quat_w, joints, ends_b, lin_vel_b, ang_vel_b, joint_vel, end_vel_b]
    return np.concatenate(parts, axis=1)


def rounded(frames: Float[np.ndarray, "t c"], controlled: int) -> Float[np.ndarray, "t c"]:
    """Round each column to its decimals for writing, without negative zeros."""
    positions = 7 + controlled + 12
    parts = [
        np.round(frames[:, :3], POSITION_DECIMALS),
        np.round(frames[:, 3:7], QUATERNION_DECIMALS),
        np.round(frames[:, 7:positions], POSITION_DECIMALS),
        np.round(frames[:, positions:], VELOCITY_DECIMALS),
    ]
    return np.concatenate(parts, axis=1) + 0.0


def numbers_text(frames: Float[np.ndarray, "t c"]) -> bytes:
    """JSON arrays of the frames, one line per frame; byte-identical to Python's `json`, 5x faster.

    Identical for 0 and for magnitudes from 1e-9; `rounded` frames have at most 8 decimals.

    Raises ValueError for a number that is not finite or has a magnitude of 1e16 or more, which has a positive exponent.
    """
    if not np.isfinite(frames).all():
        raise ValueError("a number of a frame is not finite")
    if np.abs(frames).max(initial=0.0) >= LEAST_WITH_EXPONENT:
        raise ValueError(f"a number of a frame has a size of {LEAST_WITH_EXPONENT:g} or more")
    lines = _SMALL.sub(_with_exponent, _ENCODER.encode_lines(frames.tolist())[:-1])
    first, *rest = lines.split(b"e")  # three times as fast as splitting at `e-`
    return b"e-0".join([first, *(part[1:] for part in rest)]).replace(b"\n", b",\n")


LEAST_WITH_EXPONENT = 1e16
"""Magnitude from which numbers are written with a positive exponent."""

_ENCODER = msgspec.json.Encoder()

_SMALL = re.compile(rb"0\.0000[1-9][0-9]*")
"""Numbers below 0.0001: Python writes these with a two-digit exponent, `msgspec` only below 0.00001, with one digit."""


def _with_exponent(found: re.Match[bytes]) -> bytes:
    small, before = found.group(), found.string[found.start() - 1]
    if chr(before).isdigit():  # as in 10.00002
        return small
    digits = small[len(b"0.0000") :]
    return digits[:1] + (b"." + digits[1:] if digits[1:] else b"") + b"e-5"


def _end_effectors_b(joint_pos: Float[np.ndarray, "t j"], robot: Robot) -> Float[np.ndarray, "t 12"]:
    """Left hand, right hand, left and right sole centre in the root link's frame [m]."""
    count = len(joint_pos)
    kinematics = Kinematics(robot)
    poses = kinematics.forward(np.zeros((count, 3)), np.tile(rotation.IDENTITY, (count, 1)), joint_pos)
    return kinematics.site_pos_w(poses, (*robot.hands, *robot.feet)).reshape(count, -1)


def _check(clip: RobotClip, robot: Robot) -> None:
    if clip.fps != FPS:
        raise ClipError(clip.name, "rate", f"has {clip.fps:g} Hz; the database is at {FPS:g} Hz, resample it")
    if clip.joint_names != robot.joint_names:
        raise ClipError(clip.name, "joints", f"its joints are not those of '{robot.name}', or in another order")
    if clip.frame_count < 2:
        raise ClipError(clip.name, "short", "has less than two frames, so it has no velocity")
