"""Inverse kinematics of a leg for given foot poses, all frames at once, within joint limits.

Levenberg-Marquardt from given joint angles, with a damping per frame: it decreases with each successful step, so that
the convergence becomes quadratic, and increases where a leg is nearly straight and a full step would overshoot.

At joint limits, a foot in the air may deviate from its orientation where its ankle is at its limit; a foot in stance
may not. Each stance of a foot has an offset; over swings the offset follows a minimum-jerk curve, so that position,
velocity and acceleration are continuous at touchdown and lift-off.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import convolve1d, maximum_filter1d

from pipeline import rotation, time_series
from pipeline.clips.outcome import Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.robot.robot import Tree

TOLERANCE = 1e-6
"""Largest error of a foot's position [m] and orientation [rad] that counts as reached."""

AIM = 1e-9
"""Error at which the iteration ends [m, rad]; far below the tolerance, to avoid noise in accelerations."""

MOST_STEPS = 40
"""Most iterations. Four or five are enough from a few degrees away; a stretched leg needs more."""

FIRST_DAMPING = 1e-4
"""Initial damping [m^2], added to J J^T; a leg's lever arm is about 0.5 m."""

LONGEST_STEP = 0.3
"""Largest step of a joint [rad], so that the solution stays on the same branch."""


@dataclass(frozen=True, kw_only=True)
class Leg:
    """The joints from the hip of one side to its foot; links from the hip down, the foot last."""

    base: int
    """Index of the link that the leg is attached to."""
    links: Int[np.ndarray, " n"]
    joints: Int[np.ndarray, " n"]


def legs_of(robot: Robot) -> tuple[Leg, Leg]:
    """The left and the right leg: the joints from each foot to the root that are not shared by both."""
    ways = [_way_up(robot.tree, int(robot.tree.site_link[robot.site(foot)])) for foot in robot.feet]
    legs = []
    for own, other in (ways, ways[::-1]):
        links = np.array([link for link in own if link not in other][::-1])
        legs.append(Leg(base=int(robot.tree.parent[links[0]]), links=links, joints=robot.tree.joint[links]))
    return legs[0], legs[1]


def _way_up(tree: Tree, link: int) -> list[int]:
    way = [link]
    while tree.parent[way[-1]] >= 0:
        way.append(int(tree.parent[way[-1]]))
    return way


@dataclass(frozen=True, kw_only=True)
class Reach:
    """Solution of a leg for its foot's poses."""

    joint_pos: Float[np.ndarray, "t n"]
    """Joint angles of the leg [rad]."""
    miss: Float[np.ndarray, " t"]
    """Error of the foot: the larger of position [m] and orientation [rad] error."""

    @property
    def reached(self) -> Bool[np.ndarray, " t"]:
        return self.miss < TOLERANCE


def reach(
    tree: Tree,
    leg: Leg,
    base: tuple[Float[np.ndarray, "t 3"], Float[np.ndarray, "t 4"]],
    foot: tuple[Float[np.ndarray, "t 3"], Float[np.ndarray, "t 4"]],
    joint_pos: Float[np.ndarray, "t n"],
) -> Reach:
    """Joints of a leg for poses (position [m], orientation wxyz, world frame) of its base link and of its foot.

    Args:
        joint_pos: initial joint angles [rad], which select the solution branch; joint limits are not enforced
    """
    found = joint_pos.copy()
    error, jacobian = _error_and_jacobian(tree, leg, base, foot, found)
    damping = np.full(len(found), FIRST_DAMPING)
    for _ in range(MOST_STEPS):
        open_ = np.flatnonzero(_miss(error) > AIM)
        if not len(open_):
            break
        parts = tuple((pos[open_], quat[open_]) for pos, quat in (base, foot))
        tried = found[open_] + _step(jacobian[open_], error[open_], damping[open_])
        new_error, new_jacobian = _error_and_jacobian(tree, leg, parts[0], parts[1], tried)
        better = np.square(new_error).sum(axis=1) < np.square(error[open_]).sum(axis=1)
        kept = open_[better]
        found[kept], error[kept], jacobian[kept] = tried[better], new_error[better], new_jacobian[better]
        damping[open_] *= np.where(better, 0.01, 10.0)
    return Reach(joint_pos=found, miss=_miss(error))


def _step(
    jacobian: Float[np.ndarray, "t 6 n"], error: Float[np.ndarray, "t 6"], damping: Float[np.ndarray, " t"]
) -> Float[np.ndarray, "t n"]:
    transposed = np.swapaxes(jacobian, 1, 2)
    normal = transposed @ jacobian + damping[:, None, None] * np.eye(jacobian.shape[2])
    step = np.linalg.solve(normal, transposed @ error[..., None])[..., 0]
    longest = np.abs(step).max(axis=1, keepdims=True)
    return step * np.minimum(1.0, LONGEST_STEP / np.maximum(longest, LONGEST_STEP))


def _miss(error: Float[np.ndarray, "t 6"]) -> Float[np.ndarray, " t"]:
    return np.maximum(rotation.length(error[:, :3]), rotation.length(error[:, 3:]))


def _error_and_jacobian(
    tree: Tree,
    leg: Leg,
    base: tuple[Float[np.ndarray, "t 3"], Float[np.ndarray, "t 4"]],
    foot: tuple[Float[np.ndarray, "t 3"], Float[np.ndarray, "t 4"]],
    joint_pos: Float[np.ndarray, "t n"],
) -> tuple[Float[np.ndarray, "t 6"], Float[np.ndarray, "t 6 n"]]:
    """Pose error of the foot (position, then rotation vector, world frame) and its Jacobian."""
    pos, quat = base
    origins, axes = [], []
    for index, link in enumerate(leg.links):
        pos = pos + rotation.rotate(quat, tree.pos[link])
        frame = rotation.multiply(quat, tree.quat[link])
        origins.append(pos)
        axes.append(rotation.rotate(frame, tree.axis[link]))
        quat = rotation.multiply(frame, rotation.from_axis_angle(tree.axis[link], joint_pos[:, index]))
    turn = rotation.to_rotvec(rotation.multiply(foot[1], rotation.conjugate(quat)))
    axis, lever = np.stack(axes, axis=1), pos[:, None] - np.stack(origins, axis=1)
    jacobian = np.concatenate([rotation.cross(axis, lever), axis], axis=2)
    return np.concatenate([foot[0] - pos, turn], axis=1), np.swapaxes(jacobian, 1, 2)


SHORTEST_SWING_S = 0.2
"""Duration below which a swing is not lifted [s]: a shuffling foot or a flickering label."""

PEAK = (0.4, 0.6)
"""Range of the lift's peak, as shares of the swing; closer to an end the lift would be too steep."""

LEAST_POWER = 3.0
"""Least exponent of the time from each end of a swing: velocity and acceleration of the lift begin and end at zero."""


def offset_by_stance(
    contact: Bool[np.ndarray, " t"], offset_at: Callable[[int], Float[np.ndarray, " 3"]]
) -> Float[np.ndarray, "t 3"]:
    """Offset of one foot over time: constant in stances, minimum jerk in swings.

    Args:
        contact: frames of stance
        offset_at: function of a frame; evaluated in the middle of each stance, and in the first and the last frame of
            the motion if the foot is in the air there
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
    """Minimum-jerk curve from 0 to 1 over [0, 1]: no velocity or acceleration at the ends (Flash, Hogan 1985)."""
    return along**3 * (10.0 - 15.0 * along + 6.0 * along**2)


def lift_in_swings(
    contact: Bool[np.ndarray, " t"], height: Float[np.ndarray, " t"], fps: float
) -> Float[np.ndarray, " t"]:
    """Lift profile: 0 in stances, from 0 to 1 and back in each swing, with the peak where the foot is highest.

    Swings at the start or the end of the motion and those shorter than `SHORTEST_SWING_S` are not lifted.
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
"""Number of ankle joints of a leg, and largest rotation of a foot in the air when one is at its limit [rad]."""

BLEND_S = 0.08
"""Smoothing time of that rotation [s]: it starts up to twice this time before the limit, so that the ankle does not
stop abruptly."""

LIMIT_SLACK = 1e-6
"""Tolerance of a joint at its limit [rad]."""


def within_limits(
    clip: RobotClip, robot: Robot, leg: Leg, standing: Bool[np.ndarray, " t"], found: Reach
) -> Float[np.ndarray, "t n"] | Reason:
    """A leg's joints within their limits, or the reason why the variant is infeasible: a frame out of reach, or a joint
    beyond its limit.

    A foot in the air is rotated by the excess of its ankle, up to `MOST_TURNED`; a foot in stance is not. Where the
    original exceeds a limit, the variant may exceed it by as much.
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
    """Smooth envelope of the excess: at least the excess in every frame, zero in stances."""
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
