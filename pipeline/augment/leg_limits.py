"""Legs kept within their joints' limits: a foot in the air gives way to its ankle, one that stands does not.

stances of a foot -> an offset for each -> over the swings by the shortest jerk, so that position, speed and
acceleration of the offset have no step where a foot is put down or taken up
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import convolve1d, maximum_filter1d

from pipeline import time_series
from pipeline.augment.leg_solver import Leg, Reach
from pipeline.clips.outcome import Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot

SHORTEST_SWING_S = 0.2
"""Swings below it are not lifted [s]: they are a foot that shuffles or a label that flickers."""

PEAK = (0.4, 0.6)
"""Parts of a swing between which the lift may have its peak; nearer to an end it would be too steep."""

LEAST_POWER = 3.0
"""Of the time from each end of a swing: position, speed and acceleration of the lift begin and end at zero."""


def offset_by_stance(
    contact: Bool[np.ndarray, " t"], offset_at: Callable[[int], Float[np.ndarray, " 3"]]
) -> Float[np.ndarray, "t 3"]:
    """Offset of one foot over time.

    Args:
        contact: frames in which it stands
        offset_at: the offset for a frame: it is asked for the middle of each stance, and for the first and the last
            frame of the motion where the foot is in the air there
    """
    count = len(contact)
    knots = [(start, stop - 1, offset_at((start + stop - 1) // 2)) for start, stop in time_series.runs(contact)]
    if not contact[0]:
        knots.insert(0, (0, 0, offset_at(0)))
    if not contact[-1] and count > 1:
        knots.append((count - 1, count - 1, offset_at(count - 1)))
    offset = np.empty((count, 3))
    for first, last, value in knots:
        offset[first : last + 1] = value
    for (_, left, before), (put, _, after) in itertools.pairwise(knots):
        along = np.arange(1, put - left) / (put - left)
        offset[left + 1 : put] = before + shortest_jerk(along)[:, None] * (after - before)
    return offset


def shortest_jerk(along: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """From 0 to 1 over 0 to 1, speed and acceleration zero at both ends (Flash and Hogan 1985)."""
    return along**3 * (10.0 - 15.0 * along + 6.0 * along**2)


def lift_in_swings(
    contact: Bool[np.ndarray, " t"], height: Float[np.ndarray, " t"], fps: float
) -> Float[np.ndarray, " t"]:
    """0 in stances, and in each swing from 0 to 1 and back, with the 1 where the foot is highest, near the middle.

    Swings that the motion begins or ends in are left alone, as are those shorter than `SHORTEST_SWING_S`.
    """
    lift = np.zeros(len(contact))
    for start, stop in time_series.runs(~contact):
        if start == 0 or stop == len(contact) or (stop - start + 1) / fps < SHORTEST_SWING_S:
            continue
        along = (np.arange(start, stop) - start + 1) / (stop - start + 1)
        peak = float(np.clip(along[np.argmax(height[start:stop])], *PEAK))
        rise = LEAST_POWER * max(1.0, peak / (1.0 - peak))
        fall = rise * (1.0 - peak) / peak
        lift[start:stop] = (along / peak) ** rise * ((1.0 - along) / (1.0 - peak)) ** fall
    return lift


ANKLE_JOINTS, MOST_TURNED = 2, 0.15
"""The last joints of a leg, and how far a foot in the air may turn where one of them ends [rad]."""

BLEND_S = 0.08
"""A foot begins to turn up to twice this time before its ankle ends [s], so that the ankle does not stop at once."""

LIMIT_SLACK = 1e-6
"""Rounding of a joint at its limit [rad]."""


def within_limits(
    clip: RobotClip, robot: Robot, leg: Leg, standing: Bool[np.ndarray, " t"], found: Reach
) -> Float[np.ndarray, "t n"] | Reason:
    """A leg's joints within their limits, or what keeps the robot from the variant: a frame that the leg can't reach,
    or a joint beyond its limit.

    A foot in the air turns by what its ankle lacks, up to `MOST_TURNED`; one that stands does not. Where the original
    is beyond a limit the variant may be as far beyond it.
    """
    if not found.reached.all():
        frame = int(np.argmax(found.miss))
        miss, foot = float(found.miss[frame]), robot.link_names[leg.links[-1]]
        text = f"is not made: frame {frame}: {foot} stays {100 * miss:.2f} cm short of its place."
        return _rejected("unreachable", text, clip, frame, miss, 0.0, "m")
    before = clip.joint_pos[:, leg.joints]
    lower = np.minimum(robot.joint_lower[leg.joints], before.min(axis=0))
    upper = np.maximum(robot.joint_upper[leg.joints], before.max(axis=0))
    limited = np.clip(found.joint_pos, lower, upper)
    beyond = np.abs(found.joint_pos - limited)
    given = np.zeros_like(beyond)
    given[:, -ANKLE_JOINTS:] = np.where(standing, 0.0, MOST_TURNED)[:, None]
    frame, place = (int(index) for index in np.unravel_index(np.argmax(beyond - given), beyond.shape))
    if beyond[frame, place] > given[frame, place] + LIMIT_SLACK:
        value, limit = float(found.joint_pos[frame, place]), float(limited[frame, place])
        joint = robot.joint_names[leg.joints[place]]
        text = f"is not made: frame {frame}: {joint} would be at {value:.3f} rad, beyond its limit {limit:.3f}."
        return _rejected("joint_limit", text, clip, frame, value, limit, "rad")
    for joint in range(beyond.shape[1] - ANKLE_JOINTS, beyond.shape[1]):
        for limit, sign in ((lower[joint], 1.0), (upper[joint], -1.0)):
            excess = np.maximum(sign * (limit - found.joint_pos[:, joint]), 0.0)
            early = sign * _led_in(excess, standing, clip.fps)
            limited[:, joint] = np.clip(limited[:, joint] + early - sign * excess, lower[joint], upper[joint])
    return limited


def _led_in(excess: Float[np.ndarray, " t"], standing: Bool[np.ndarray, " t"], fps: float) -> Float[np.ndarray, " t"]:
    """At least the excess in every frame, nothing in stances, and in each swing as smooth as there is time for."""
    led = excess.copy()
    for start, stop in time_series.runs(~standing):
        swing = excess[start:stop]
        for reach in range(round(BLEND_S * fps) if swing.max() > LIMIT_SLACK else 0, 0, -1):
            padded = np.pad(swing, 2 * reach)
            weight = np.hanning(2 * reach + 3)[1:-1]
            wide = convolve1d(maximum_filter1d(padded, 2 * reach + 1), weight / weight.sum(), mode="constant")
            before, after = wide[: 2 * reach], wide[len(wide) - 2 * reach :]
            if (start == 0 or before.max() == 0.0) and (stop == len(excess) or after.max() == 0.0):
                led[start:stop] = wide[2 * reach : len(wide) - 2 * reach]
                break
    return led


def _rejected(code: str, text: str, clip: RobotClip, frame: int, value: float, limit: float, unit: str) -> Reason:
    place = {"start_s": frame / clip.fps, "stop_s": (frame + 1) / clip.fps}
    return Reason(code=code, text=text, effect="rejected", value=value, limit=limit, unit=unit, **place)
