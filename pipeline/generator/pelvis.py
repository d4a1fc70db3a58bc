"""Pelvis, trunk and arm motion over the feet: path, sway, rotation, and height limited by the legs."""

import itertools
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.ndimage import minimum_filter1d

from pipeline import rotation
from pipeline.generator import gait, skeleton
from pipeline.generator.command import GRID_HZ, Commands, Recipe
from pipeline.generator.feet import Foot, hermite
from pipeline.generator.footsteps import Stride
from pipeline.physics import GRAVITY

X, Y, Z = np.eye(3)

CHEST_TURN = 0.8
"""Ratio of the chest's counter-rotation to the pelvis' rotation [-]: the thorax rotates by 3 to 5 degrees
(Stokes et al. 1989)."""
ABDUCTION = np.deg2rad(14.0)
"""Upper arms away from the body [rad]; people: 5 to 10, a little more keeps a robot's arms free."""


def _sway(recipe: Recipe, commands: Commands, stride: Stride) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Turn with the steps, list to the swing side and forward lean of the trunk (n,) [rad]."""
    turn = gait.pelvis_turn(commands.forward) * stride.activity * stride.wave()
    listing = gait.pelvis_list(recipe.gait, commands.forward) * stride.activity * stride.wave(from_midstance=True)
    return turn, listing, gait.trunk_lean(recipe.gait, commands.forward)


def move_trunk(recipe: Recipe, commands: Commands, stride: Stride) -> dict[str, Float[np.ndarray, "n 4"]]:
    """World orientations wxyz of `Spine`, `Chest`, `Neck`, `Head`."""
    turn, listing, lean = _sway(recipe, commands, stride)
    return {
        "Spine": _upright(commands.heading, 0.0 * turn, 0.3 * listing, 0.7 * lean),
        "Chest": _upright(commands.heading, CHEST_TURN * turn, -0.2 * listing, lean),
        "Neck": _upright(commands.heading, 0.4 * turn, 0.0 * listing, 0.7 * lean),
        "Head": _upright(commands.heading, 0.0 * turn, 0.0 * listing, 0.4 * lean),
    }


def _upright(heading: np.ndarray, turn: np.ndarray, listing: np.ndarray, lean: np.ndarray) -> np.ndarray:
    quat = rotation.about_z(heading + turn)
    quat = rotation.multiply(quat, rotation.from_axis_angle(X, listing))
    return rotation.multiply(quat, rotation.from_axis_angle(Y, lean))


def move_arm(
    recipe: Recipe, commands: Commands, stride: Stride, chest_w: Float[np.ndarray, "n 4"], side: int
) -> tuple[Float[np.ndarray, "n 4"], Float[np.ndarray, "n 4"]]:
    """World orientations wxyz of upper arm and forearm, canonical (a hanging arm is upright), of side 0 (left) or 1.

    The left arm is furthest back as the left foot lands. Upper arm: abduction, swing, then a turn inwards.
    """
    sign = 1.0 if side == 0 else -1.0
    rng = np.random.default_rng([recipe.seed, 2, side])
    scale, rest = rng.uniform(0.95, 1.05), np.deg2rad(rng.uniform(-1.5, 1.5))
    swing = -sign * stride.wave() * stride.activity
    running = recipe.gait == gait.RUN
    middle = np.deg2rad(-14.0) if running else np.deg2rad(2.0)
    flexion = middle + rest + scale * gait.arm_swing(recipe.gait, commands.forward) * swing
    mean_bend = gait.elbow_flexion(recipe.gait, commands.forward)
    bend = mean_bend + 0.35 * gait.arm_swing(recipe.gait, commands.forward) * swing
    inward = np.deg2rad(10.0 if running else 6.0)
    upper = rotation.multiply(chest_w, rotation.from_axis_angle(X, sign * ABDUCTION))
    upper = rotation.multiply(upper, rotation.from_axis_angle(Y, -flexion))
    upper = rotation.multiply(upper, rotation.from_axis_angle(Z, -sign * inward))
    return upper, rotation.multiply(upper, rotation.from_axis_angle(Y, -bend))


LONGEST_LEG = 0.99 * (skeleton.THIGH + skeleton.SHANK)
"""Hip to ankle at most [m]: a knee bent by 16 degrees. People land with 5 degrees; a little more keeps knee speeds
low and suits robots, which do not walk on straight knees. [judgement]"""
WIDEST_REACH = 0.72 * LONGEST_LEG
"""Ankle from its hip along the floor at most [m], 46 degrees from the vertical; beyond it nobody walks. [judgement]"""
HEIGHT_WINDOW_S = 0.75
"""Half the time over which the height is levelled, longer than half a stride [s]."""


def move_pelvis(
    recipe: Recipe, commands: Commands, stride: Stride, feet: Sequence[Foot]
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 4"]]:
    """Positions [m] and orientations wxyz of the pelvis in the world, at `GRID_HZ`.

    The landing foot's side is ahead. Raises ValueError where a foot is out of a leg's reach.
    """
    turn, listing, lean = _sway(recipe, commands, stride)
    quat_w = _upright(commands.heading, -turn, listing, 0.4 * lean)
    side = gait.sway(recipe.gait, commands.forward, commands.lateral, commands.yaw_rate) * stride.activity
    side = side * stride.wave(from_midstance=True) + _idle(recipe, commands.times, 0) * (1.0 - stride.activity)
    along = _idle(recipe, commands.times, 1) * (1.0 - stride.activity) + gait.body_ahead(recipe.gait, commands.forward)
    cosine, sine = np.cos(commands.heading), np.sin(commands.heading)
    pos_w = np.zeros((len(side), 3))
    pos_w[:, 0] = commands.path_w[:, 0] + cosine * along - sine * side
    pos_w[:, 1] = commands.path_w[:, 1] + sine * along + cosine * side
    limit = _highest(recipe, pos_w, quat_w, feet)
    if recipe.gait == gait.RUN:
        pos_w[:, 2] = _running_height(commands, stride, limit)
    else:
        wave = gait.bob(commands.forward) * stride.activity * stride.wave(2, from_midstance=True)
        pos_w[:, 2] = _level(limit - wave) + wave
    return pos_w, quat_w


def _idle(recipe: Recipe, times: np.ndarray, channel: int) -> np.ndarray:
    """Slow sway of a standing person [m] (n,): three sines of .1 to .4 Hz, together at most 6 mm (Winter 1995)."""
    rng = np.random.default_rng([recipe.seed, 1, channel])
    rates_hz, starts = rng.uniform(0.1, 0.4, 3), rng.uniform(0.0, 2.0 * np.pi, 3)
    return 0.002 * np.sin(2.0 * np.pi * rates_hz * times[:, None] + starts).sum(axis=1)


def _highest(recipe: Recipe, pos_w: np.ndarray, quat_w: np.ndarray, feet: Sequence[Foot]) -> np.ndarray:
    """Largest height of the pelvis (n,) [m] at which neither leg is longer than `LONGEST_LEG`."""
    limits = []
    for side, foot in zip(("Left", "Right"), feet, strict=True):
        hip = rotation.rotate(quat_w, skeleton.offset(f"{side}UpLeg"))
        across = np.linalg.norm(foot.ankle_w[:, :2] - pos_w[:, :2] - hip[:, :2], axis=-1)
        if across.max() > WIDEST_REACH:
            frame = int(across.argmax())
            raise ValueError(
                f"recipe '{recipe.name}': at grid index {frame} a foot is {across.max():.2f} m from below its hip, "
                f"allowed are {WIDEST_REACH:.2f} m; take shorter or quicker steps."
            )
        limits.append(foot.ankle_w[:, 2] + np.sqrt(LONGEST_LEG**2 - across**2) - hip[:, 2])
    return np.minimum(*limits)


def _level(limit: np.ndarray) -> np.ndarray:
    """A smooth curve (n,) below `limit`: the least of a window, averaged over the same window.

    The mean's weights are a cosine bell to the fourth power, so the curve has several continuous derivatives; every
    value averaged is a minimum over a window that holds the point, so the curve nowhere exceeds the limit.
    """
    half = int(HEIGHT_WINDOW_S * GRID_HZ)
    least = minimum_filter1d(limit, 2 * half + 1, mode="nearest")
    weights = np.cos(np.linspace(-np.pi / 2, np.pi / 2, 2 * half + 1)) ** 4
    padded = np.pad(least, half, mode="edge")
    return np.convolve(padded, weights / weights.sum(), mode="valid")


def _running_height(commands: Commands, stride: Stride, limit: np.ndarray) -> np.ndarray:
    """Height of the pelvis (n,) [m]: parabolas of 9.81 m/s² in flight, polynomials of degree five in stance.

    A flight begins and ends at the same height; stances take over height, velocity and acceleration (-g) at
    both ends. The height is levelled twice: once for the shape, once more for what the stance adds to it.
    """
    edges = sorted((stance.start_s, stance.stop_s) for stances in stride.stances for stance in stances)
    shape = _bounces(commands.times, edges, np.zeros(len(edges) + 1))
    base = _level(limit - shape)
    middles = [edges[0][0]] + [0.5 * (a[1] + b[0]) for a, b in itertools.pairwise(edges)] + [edges[-1][1]]
    levels = np.interp(middles, commands.times, base)
    return _bounces(commands.times, edges, levels)


def _bounces(times: np.ndarray, stances: list[tuple[float, float]], levels: np.ndarray) -> np.ndarray:
    """Height (n,) over stances (start, stop) [s] in order; `levels` (one more) are those of touch-down and
    take-off before, between and after them [m]."""
    height = np.full(len(times), levels[0])
    flights = [0.1] + [b[0] - a[1] for a, b in itertools.pairwise(stances)] + [0.1]
    for index, (start_s, stop_s) in enumerate(stances):
        speeds = -0.5 * GRAVITY * flights[index], 0.5 * GRAVITY * flights[index + 1]
        inside = (times >= start_s) & (times <= stop_s)
        ends = [
            [np.array([level]), np.array([speed]), np.array([-GRAVITY])]
            for level, speed in zip(levels[index : index + 2], speeds, strict=True)
        ]
        height[inside] = hermite((times[inside] - start_s) / (stop_s - start_s), stop_s - start_s, *ends)[:, 0]
        since = times - stop_s
        flying = (since > 0.0) & (since < flights[index + 1])
        height[flying] = levels[index + 1] + 0.5 * GRAVITY * since[flying] * (flights[index + 1] - since[flying])
    return height
