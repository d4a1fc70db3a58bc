"""Planar motion of a body: forward and lateral velocity and yaw rate, per frame and as mean (equivalent command).

    clip -> short gaps bridged -> continuous stretches -> facing, heading-frame velocity, yaw rate

A stretch ends where the root makes an implausibly large step (teleport); signals are smoothed only within stretches.

Gaps up to 0.1 s are interpolated by a spline, which preserves accelerations and is as accurate as other methods
(Sensors 21:6115, 2021). In longer gaps it may overshoot, so linear interpolation is used, which gives the mean
velocity.
"""

import dataclasses
import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.interpolate import CubicSpline

from pipeline import rotation, time_series
from pipeline.clips.human_clip import BODIES, FEET, HumanClip
from pipeline.clips.robot_clip import RobotClip

SPLINE_S = 0.1
"""Longest gap that is bridged by a spline [s]."""
SPLINE_FRAMES = 4
"""Least recorded frames for a spline; fewer are interpolated linearly."""


def short_gaps(recorded: Bool[np.ndarray, " t"], fps: float, longest_s: float) -> Bool[np.ndarray, " t"]:
    """Frames in gaps up to `longest_s` [s] between two recorded frames, excluding the ends."""
    inside = np.zeros(len(recorded), dtype=bool)
    for start, stop in time_series.runs(~recorded):
        inside[start:stop] = start > 0 and stop < len(recorded) and (stop - start) / fps <= longest_s + 1e-9
    return inside


def bridge(
    values: Float[np.ndarray, "t k"], recorded: Bool[np.ndarray, " t"], fps: float, longest_s: float
) -> Float[np.ndarray, "t k"]:
    """Values with gaps up to `longest_s` [s] interpolated; all other values are unchanged."""
    inside = short_gaps(recorded, fps, longest_s)
    result = np.array(values, dtype=float)
    if not inside.any():
        return result
    known, gap = np.flatnonzero(recorded), np.flatnonzero(inside)
    for column in range(result.shape[1]):
        result[gap, column] = np.interp(gap, known, values[known, column])
    brief = np.flatnonzero(inside & short_gaps(recorded, fps, min(SPLINE_S, longest_s)))
    if len(known) >= SPLINE_FRAMES and len(brief):
        result[brief] = CubicSpline(known, values[known], axis=0)(brief)
    return result


def bridge_positions(clip: HumanClip, longest_s: float) -> HumanClip:
    """The clip with each body's positions bridged; orientations are unchanged."""
    recorded = np.asarray(np.isfinite(clip.body_pos_w).all(axis=2))
    if recorded.all():
        return clip
    pos = clip.body_pos_w.copy()
    for index in range(len(BODIES)):
        pos[:, index] = bridge(pos[:, index], recorded[:, index], clip.fps, longest_s)
    return dataclasses.replace(clip, body_pos_w=pos)


TELEPORT_M_S = 15.0
"""Speed of the root above which there is a break in the recording [m/s]; the fastest sprint is 12.4 m/s."""
TELEPORT_STEP = 0.05
"""Displacement below which there is no break at any rate [m]: marker jitter at 1000 Hz is fast too."""


@dataclass(frozen=True, kw_only=True)
class PlanarMotion:
    """Signals of one clip at its own rate. They are meaningless where `valid` is false."""

    forward: Float[np.ndarray, " t"]
    """Velocity of the root along the facing [m/s]."""
    lateral: Float[np.ndarray, " t"]
    """Velocity of the root to the left of the facing [m/s]."""
    yaw_rate: Float[np.ndarray, " t"]
    """Of the facing about the world's z [rad/s], left is positive."""
    recorded: Bool[np.ndarray, " t"]
    """Frames in which root and facing were recorded."""
    valid: Bool[np.ndarray, " t"]
    """Recorded or bridged, in a stretch that is long enough for a velocity."""

    @property
    def speed(self) -> Float[np.ndarray, " t"]:
        """Horizontal speed of the root [m/s]."""
        return np.hypot(self.forward, self.lateral)


def planar_motion(clip: HumanClip | RobotClip, velocity_s: float, facing_s: float, bridge_s: float) -> PlanarMotion:
    """The clip's planar motion.

    Args:
        clip: a person's or a robot's motion
        velocity_s: width of the moving mean on the root's velocity [s]
        facing_s: width of the moving mean on the facing [s]: the normal of the line between a person's hips, the
            heading of a robot's root
        bridge_s: longest gap of the recording that is interpolated first [s]
    """
    fps, (root_w, facing_w) = clip.fps, _root_and_facing(clip)
    recorded = np.asarray(np.isfinite(np.concatenate([root_w, facing_w], axis=1)).all(axis=1))
    turned = np.zeros(clip.frame_count)
    turned[recorded] = np.unwrap(np.arctan2(facing_w[recorded, 1], facing_w[recorded, 0]))
    path = bridge(np.column_stack([root_w, turned]), recorded, fps, bridge_s)
    known = np.logical_or(recorded, short_gaps(recorded, fps, bridge_s))
    velocity_w, yaw, yaw_rate = np.zeros((len(known), 2)), np.zeros(len(known)), np.zeros(len(known))
    valid = np.zeros(len(known), dtype=bool)
    for start, stop in _stretches(path[:, :3], known, fps):
        if stop - start < max(2, round(velocity_s * fps)):
            continue
        part = slice(start, stop)
        valid[part] = True
        velocity_w[part] = time_series.moving_mean(time_series.derivative(path[part, :2], fps), _odd(velocity_s * fps))
        yaw[part] = _mean_of_trend(path[part, 3], facing_s, fps)
        yaw_rate[part] = time_series.derivative(yaw[part], fps)
    cos, sin = np.cos(yaw), np.sin(yaw)
    return PlanarMotion(
        forward=cos * velocity_w[:, 0] + sin * velocity_w[:, 1],
        lateral=cos * velocity_w[:, 1] - sin * velocity_w[:, 0],
        yaw_rate=yaw_rate,
        recorded=recorded,
        valid=valid,
    )


def _root_and_facing(clip: HumanClip | RobotClip) -> tuple[np.ndarray, np.ndarray]:
    """Root position (t, 3) and horizontal facing of unit length (t, 2), NaN where not recorded."""
    if isinstance(clip, RobotClip):
        yaw = rotation.yaw_of(clip.root_quat_w)
        return clip.root_pos_w, np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    return clip.pos("pelvis"), facing_of(clip)


def facing_of(clip: HumanClip) -> np.ndarray:
    """Horizontal normal of the line between a person's hips (t, 2), unit."""
    left = clip.pos("left_hip") - clip.pos("right_hip")
    return rotation.normalize(np.stack([left[:, 1], -left[:, 0]], axis=1))


def leg_length(clip: HumanClip) -> float:
    """Thigh plus shank [m], median over frames, mean of both sides; NaN where nothing was recorded."""
    sides = []
    for side in FEET:
        hip, knee, ankle = (clip.pos(f"{side}_{part}") for part in ("hip", "knee", "ankle"))
        length = rotation.length(knee - hip) + rotation.length(ankle - knee)
        length = length[np.isfinite(length)]
        sides.append(float(np.median(length)) if len(length) else float("nan"))
    return sum(sides) / len(sides)


def _stretches(root_w: np.ndarray, known: np.ndarray, fps: float) -> list[tuple[int, int]]:
    """Frame ranges that are known throughout and without a teleport."""
    breaks = np.flatnonzero(_teleports(np.where(known[:, None], root_w, 0.0), fps)) + 1
    pieces = []
    for start, stop in time_series.runs(known):
        edges = [start, *breaks[(breaks > start) & (breaks < stop)].tolist(), stop]
        pieces += list(itertools.pairwise(edges))
    return pieces


def _teleports(root_w: np.ndarray, fps: float) -> np.ndarray:
    """Mask of implausibly large steps of the root from frame to frame."""
    step = np.linalg.norm(np.diff(root_w, axis=0), axis=1)
    return (step > TELEPORT_STEP) & (step * fps > TELEPORT_M_S)


def teleport_share(clip: HumanClip | RobotClip) -> float:
    """Share of implausibly large root steps between recorded frames; 0 without steps."""
    root_w = _root_and_facing(clip)[0]
    known = np.isfinite(root_w[1:] + root_w[:-1]).all(axis=1)
    return float(_teleports(root_w, clip.fps)[known].mean()) if known.any() else 0.0


def _mean_of_trend(values: np.ndarray, width_s: float, fps: float) -> np.ndarray:
    """Moving mean with the ends extended by point reflection, for values with a trend."""
    half = min(_odd(width_s * fps) // 2, len(values) - 1)
    before = 2.0 * values[0] - values[half:0:-1]
    after = 2.0 * values[-1] - values[-2 : -half - 2 : -1]
    extended = np.concatenate([before, values, after])
    return time_series.moving_mean(extended, 2 * half + 1)[half : half + len(values)]


def _odd(frames: float) -> int:
    """The nearest odd number."""
    return 2 * round((frames - 1.0) / 2.0) + 1


STRIDE_S = 1.0
"""Averaging time over which sway and bobbing of a gait cancel: about one stride [s]."""


@dataclass(frozen=True, kw_only=True)
class CommandVelocity:
    """Means over a motion."""

    forward_m_s: float
    lateral_m_s: float
    """Lateral velocity, positive to the left."""
    yaw_rate_rad_s: float
    """Yaw rate, positive to the left (counter-clockwise from above)."""


def command_velocity(
    root_pos_w: Float[np.ndarray, "t 3"], root_quat_w: Float[np.ndarray, "t 4"], fps: float
) -> CommandVelocity:
    """Mean velocity of the root in its own heading frame at each time, and mean yaw rate.

    The heading is the twist of the root about the vertical, so it does not depend on tilt.
    """
    return command_velocities(root_pos_w, root_quat_w, fps)[0]


def command_velocities(
    root_pos_w: Float[np.ndarray, "t 3"], root_quat_w: Float[np.ndarray, "t 4"], fps: float
) -> tuple[CommandVelocity, Float[np.ndarray, "t 3"]]:
    """Means as in `command_velocity`; forward and lateral velocity [m/s] and yaw rate [rad/s] at each frame, as a mean
    over `STRIDE_S` about it.

    The velocity is transformed to the heading frame before averaging, so that walking on a curve does not reduce it. At
    the ends of the motion the window shrinks.
    """
    yaw, velocity = _in_heading_frame(root_pos_w, root_quat_w, fps)
    command = np.concatenate([velocity[:, :2], time_series.derivative(yaw, fps)[:, None]], axis=1)
    over_time = time_series.moving_mean(command, 2 * round(STRIDE_S * fps / 2.0) + 1)
    if len(root_pos_w) < 2:
        return CommandVelocity(forward_m_s=0.0, lateral_m_s=0.0, yaw_rate_rad_s=0.0), over_time
    turned = float(yaw[-1] - yaw[0]) * fps / (len(yaw) - 1)
    forward, lateral = (float(velocity[:, axis].mean()) for axis in range(2))
    return CommandVelocity(forward_m_s=forward, lateral_m_s=lateral, yaw_rate_rad_s=turned), over_time


def _in_heading_frame(root_pos_w: np.ndarray, root_quat_w: np.ndarray, fps: float) -> tuple[np.ndarray, np.ndarray]:
    """Heading [rad] (t,), unwrapped, and the root's velocity in its frame [m/s] (t, 3)."""
    yaw = np.unwrap(rotation.yaw_of(root_quat_w))
    return yaw, rotation.rotate_inverse(rotation.about_z(yaw), time_series.derivative(root_pos_w, fps))
