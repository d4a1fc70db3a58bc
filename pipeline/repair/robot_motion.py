"""KP2 for robot trajectories: check for non-finite values, jumps and joint limits, and place the pieces.

A sole is in contact within a few millimetres of the stance height of the clip's soles. This margin is derived from the
spread of the soles' stance heights, so that neither the floor height nor the noise has to be known.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series
from pipeline.clips.outcome import Outcome, Piece, Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.quality.sole import sole_motion
from pipeline.repair import reasons
from pipeline.repair.contacts import Contacts
from pipeline.repair.floor import densest, mean_heading
from pipeline.repair.robot_outliers import Dropout, find_dropouts, without_spikes
from pipeline.repair.settings import RepairSettings, RobotSettings
from pipeline.repair.tree import FrameMask
from pipeline.robot import Robot

BAND = 0.01
"""Width of the height band of soles in stance [m]."""
SPREADS, LEAST, MOST = 2.0, 0.0015, 0.01
"""Contact margin over the median stance height: `SPREADS` times the spread of stance heights, clipped to
`LEAST` ... `MOST` [m]."""
FASTEST = 1.5
"""Horizontal speed above which a corner is not in stance [m/s]."""
SHORTEST_S = 0.04
"""Contacts and gaps shorter than this are ignored [s]."""


def label_robot_contacts(clip: RobotClip, robot: Robot) -> Contacts:
    """Foot on the ground (left, right)."""
    sole = sole_motion(clip, robot)
    low = sole.height
    standing = low[np.abs(low - densest(low.ravel(), BAND)) <= BAND / 2.0]
    ground = float(np.median(standing))
    spread = 1.4826 * float(np.median(np.abs(standing - ground)))
    limit = ground + float(np.clip(SPREADS * spread, LEAST, MOST))
    touching = (low < limit) & (sole.lowest_corner_speed < FASTEST)
    shortest = round(SHORTEST_S * clip.fps)
    return np.stack([time_series.without_short_runs(side, shortest) for side in touching.T], axis=1)


QUAT_NORM_CHANGE = 0.01


def process_robot(clip: RobotClip, start: int, stop: int, *, settings: RepairSettings, robot: Robot | None) -> Outcome:
    """Repair the window [start, stop) of a robot's trajectory.

    Spikes of a frame or two are filled. Frames of longer dropouts, frames that are not finite and frames whose joints
    move faster than a jump are cut.
    With a robot, small violations of joint limits are clamped; larger ones are left to the feasibility stage.
    """
    speed_limit = _speed_limit(clip, robot, settings.robot)
    clip, spikes = without_spikes(clip)
    dropouts = find_dropouts(clip, settings.detection.longest_spike_s)
    bad, gathered = _bad_frames(clip, speed_limit, dropouts)
    clamped, clamps = _clamped(clip, robot, settings.robot)
    gathered += [*spikes, *clamps]
    pieces = []
    whole = [(low + start, high + start) for low, high in time_series.runs(~bad[start:stop])]
    kept = [(low, high) for low, high in whole if (high - low) / clip.fps >= settings.min_seconds]
    gathered += [
        reasons.too_short(low, high, clip.fps, settings.min_seconds) for low, high in whole if (low, high) not in kept
    ]
    for number, (low, high) in enumerate(kept, start=1):
        piece = clamped.cut(low, high, f"{clip.name}+{number}" if len(kept) > 1 else clip.name)
        if robot is not None and clip.contacts is None:
            piece = dataclasses.replace(piece, contacts=label_robot_contacts(piece, robot))
        pieces.append(_placed(piece, low, settings))
    filled = sum(round(((each.stop_s or 0.0) - (each.start_s or 0.0)) * clip.fps) for each in spikes)
    cut = stop - start - sum(piece.clip.frame_count for piece in pieces)
    return Outcome(pieces=tuple(pieces), reasons=tuple(gathered), numbers={"filled_frames": filled, "cut_frames": cut})


def _speed_limit(clip: RobotClip, robot: Robot | None, settings: RobotSettings) -> Float[np.ndarray, " j"]:
    """Joint speed above which a step is a jump [rad/s] (j,). Raises ClipError for joints the robot lacks."""
    if robot is None:
        return np.full(len(clip.joint_names), settings.speed_limit_share * settings.default_speed_limit)
    if clip.joint_names != robot.joint_names:
        problem = f"its joints are {', '.join(clip.joint_names)}; the robot '{robot.name}' has others"
        raise ClipError(clip.name, "joints", problem)
    return settings.speed_limit_share * robot.motor_speed_limit


def _bad_frames(clip: RobotClip, speed_limit: np.ndarray, dropouts: list[Dropout]) -> tuple[FrameMask, list[Reason]]:
    """Frames to cut, and why."""
    norm = np.linalg.norm(clip.root_quat_w, axis=1)
    finite = np.isfinite(clip.root_pos_w).all(axis=1) & np.isfinite(clip.joint_pos).all(axis=1) & np.isfinite(norm)
    unit = np.abs(np.where(finite, norm, 1.0) - 1.0) <= QUAT_NORM_CHANGE
    found = (("missing", "not a number", ~finite), ("no_rotation", "root quaternion not unit", ~unit))
    gathered = [
        reasons.refused(code, f"{problem}; {reasons.CUT}", frames, clip.fps)
        for code, problem, bad in found
        for frames in time_series.runs(bad)
    ]
    away = np.zeros(clip.frame_count, dtype=bool)
    for dropout in dropouts:
        away[dropout.start : dropout.stop] = True
        gathered.append(dropout.reason(clip.fps))
    known = finite & ~away
    speed = np.abs(np.diff(np.where(known[:, None], clip.joint_pos, 0.0), axis=0)) * clip.fps
    speed[~(known[1:] & known[:-1])] = 0.0
    too_fast = np.concatenate([[False], (speed > speed_limit).any(axis=1)])
    too_fast[:-1] |= too_fast[1:]
    for low, high in time_series.runs(too_fast):
        span = speed[low : high - 1]
        joint = int(np.argmax((span / speed_limit).max(axis=0)))
        fastest, limit = float(span[:, joint].max()), float(speed_limit[joint])
        moves = f"joint '{clip.joint_names[joint]}' moves at {fastest:.1f} rad/s"
        problem = f"{moves}, allowed are {limit:.1f} rad/s; {reasons.CUT}"
        gathered.append(reasons.refused("joint_jump", problem, (low, high), clip.fps, fastest, limit, "rad/s"))
    return ~known | ~unit | too_fast, gathered


def _clamped(clip: RobotClip, robot: Robot | None, settings: RobotSettings) -> tuple[RobotClip, list[Reason]]:
    """Clamp joint angles that exceed their limits by at most `settings.clamp`."""
    if robot is None:
        return clip, []
    over = np.maximum(clip.joint_pos - robot.joint_upper, robot.joint_lower - clip.joint_pos)
    little = (over > 0.0) & (over <= settings.clamp)
    if not little.any():
        return clip, []
    joint_pos = np.where(little, np.clip(clip.joint_pos, robot.joint_lower, robot.joint_upper), clip.joint_pos)
    gathered = []
    for joint in np.flatnonzero(little.any(axis=0)):
        most = float(over[little[:, joint], joint].max())
        passes = f"joint '{clip.joint_names[joint]}' passes its limit by up to {most:.3f} rad"
        text = f"{passes} in {little[:, joint].mean():.0%} of the frames; put on the limit"
        numbers = {"value": most, "limit": settings.clamp, "unit": "rad"}
        gathered.append(Reason(code="joint_limit", text=text, effect="repaired", **numbers))
    return dataclasses.replace(clip, joint_pos=joint_pos), gathered


def _placed(clip: RobotClip, first: int, settings: RepairSettings) -> Piece:
    """Move the piece to the origin with heading +x; its height, which KP5 checks, is kept."""
    quat_w = rotation.make_continuous(rotation.normalize(clip.root_quat_w))
    heading = mean_heading(quat_w[: max(1, round(settings.heading_s * clip.fps))])
    back = rotation.about_z(-heading)
    origin = np.array([*clip.root_pos_w[0, :2], 0.0])
    placed = dataclasses.replace(
        clip,
        root_pos_w=rotation.rotate(back, clip.root_pos_w - origin),
        root_quat_w=rotation.make_continuous(rotation.multiply(back, quat_w)),
    )
    numbers = {
        "seconds": clip.duration_s,
        "start_frame": first,
        "stop_frame": first + clip.frame_count,
        "heading_rad": heading,
        "origin_x_m": float(origin[0]),
        "origin_y_m": float(origin[1]),
        "floor_m": 0.0,
        "filled_frames": 0,
        "stance_slip_m_s": None,
    }
    return Piece(clip=placed, numbers=numbers)
