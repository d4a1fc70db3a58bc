"""Foot trajectories: rolling over a planted point in stance, a smooth arc in swing.

In stance the foot rotates about its heel while its toes are up, and about its toe joint while its heel is
up (the toes stay flat); the pivot does not move. In swing each coordinate is the
polynomial of degree five that takes over position, velocity and acceleration from the stances at both
ends, plus a bump that vanishes with its second derivative at both ends: twice continuously
differentiable throughout.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pipeline.generator import gait, skeleton
from pipeline.generator.command import Commands, Recipe
from pipeline.generator.footsteps import Stance


def hermite(s: np.ndarray, duration_s: float, start: list[np.ndarray], stop: list[np.ndarray]) -> np.ndarray:
    """Polynomial of degree five (n, k) on s in [0, 1] from value, velocity and acceleration (k,) at both ends."""
    scale = np.array([1.0, duration_s, duration_s**2])
    ends = [part * factor for part, factor in zip((*start, *stop), (*scale, *scale), strict=True)]
    weights = np.stack(
        [
            1 - 10 * s**3 + 15 * s**4 - 6 * s**5,
            s - 6 * s**3 + 8 * s**4 - 3 * s**5,
            0.5 * s**2 - 1.5 * s**3 + 1.5 * s**4 - 0.5 * s**5,
            10 * s**3 - 15 * s**4 + 6 * s**5,
            -4 * s**3 + 7 * s**4 - 3 * s**5,
            0.5 * s**3 - s**4 + 0.5 * s**5,
        ],
        axis=-1,
    )
    return weights @ np.stack(ends)


MIDDLE_AHEAD = 0.045
"""Distance of the foothold (middle of the foot) in front of the ankle [m]."""
HEEL = np.array([-skeleton.HEEL_BACK, -skeleton.ANKLE_HEIGHT])
"""Rear end of the sole from the ankle (forward, up), flat foot [m]."""
BALL = np.array([skeleton.BALL_AHEAD, skeleton.BALL_HEIGHT - skeleton.ANKLE_HEIGHT])
"""Toe joint from the ankle (forward, up), flat foot [m]."""


@dataclass(frozen=True, kw_only=True)
class Foot:
    """One foot at `GRID_HZ`, world frame."""

    ankle_w: Float[np.ndarray, "n 3"]
    """Ankle joint [m]."""
    yaw: Float[np.ndarray, " n"]
    """[rad]"""
    pitch: Float[np.ndarray, " n"]
    """Heel up positive [rad]."""
    toe_bend: Float[np.ndarray, " n"]
    """Toes up against the foot [rad]."""
    contact: Bool[np.ndarray, " n"]
    """Whether the foot is on the ground."""


def move_foot(recipe: Recipe, commands: Commands, stances: tuple[Stance, ...]) -> Foot:
    """The foot over the whole duration."""
    times = commands.times
    values = np.zeros((len(times), 6))
    contact = np.zeros(len(times), dtype=bool)
    for stance in stances:
        inside = (times >= stance.start_s) & (times <= stance.stop_s)
        values[inside] = _in_stance(stance, times[inside])[0]
        contact |= inside
    for before, after in itertools.pairwise(stances):
        inside = (times > before.stop_s) & (times < after.start_s)
        values[inside] = _in_swing(recipe, commands, before, after, times[inside])
    return Foot(ankle_w=values[:, :3], yaw=values[:, 3], pitch=values[:, 4], toe_bend=values[:, 5], contact=contact)


def _in_stance(stance: Stance, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ankle x, y, z, yaw, pitch and toe bend (n, 6), their velocities and accelerations, in a stance."""
    pitch, rate, acceleration = _roll(stance, times)
    pivot = np.where((pitch > 0.0)[:, None], BALL, HEEL)
    cosine, sine = np.cos(pitch), np.sin(pitch)
    # from the pivot to the ankle, turned nose down by the pitch: (forward, up) and its derivative by the pitch
    arm = -pivot
    turned = np.stack([cosine * arm[:, 0] + sine * arm[:, 1], -sine * arm[:, 0] + cosine * arm[:, 1]], axis=-1)
    slope = np.stack([turned[:, 1], -turned[:, 0]], axis=-1)
    place = turned + pivot - [MIDDLE_AHEAD, 0.0]
    speed = slope * rate[:, None]
    change = slope * acceleration[:, None] - turned * (rate**2)[:, None]
    height = np.full(len(times), skeleton.ANKLE_HEIGHT)
    zeros, bent = np.zeros(len(times)), pitch > 0.0
    ahead, across = np.cos(stance.yaw), np.sin(stance.yaw)
    value = [stance.x + ahead * place[:, 0], stance.y + across * place[:, 0], height + place[:, 1]]
    value += [zeros + stance.yaw, pitch, np.where(bent, pitch, 0.0)]
    velocity = [ahead * speed[:, 0], across * speed[:, 0], speed[:, 1], zeros, rate, np.where(bent, rate, 0.0)]
    second = [ahead * change[:, 0], across * change[:, 0], change[:, 1], zeros, acceleration]
    second += [np.where(bent, acceleration, 0.0)]
    return np.stack(value, axis=-1), np.stack(velocity, axis=-1), np.stack(second, axis=-1)


def _roll(stance: Stance, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pitch of a standing foot (n,) with rate and acceleration: down after landing, flat, up before leaving.

    Each part is 2 u³ - u⁴ of the time u from or to the flat foot: it starts from rest with no acceleration and
    touches down or lifts off at full rate, again with no acceleration.
    """
    parts = []
    for u, sign, duration_s, pitch in (
        ((stance.start_s + stance.landing_s - times) / stance.landing_s, -1.0, stance.landing_s, stance.landing_pitch),
        ((times - stance.stop_s + stance.leaving_s) / stance.leaving_s, 1.0, stance.leaving_s, stance.leaving_pitch),
    ):
        u = np.clip(u, 0.0, 1.0)
        value, rate, acceleration = 2 * u**3 - u**4, 6 * u**2 - 4 * u**3, 12 * u - 12 * u**2
        parts.append(pitch * np.stack([value, sign * rate / duration_s, acceleration / duration_s**2]))
    return tuple(parts[0] + parts[1])


def _in_swing(
    recipe: Recipe, commands: Commands, before: Stance, after: Stance, times: np.ndarray
) -> Float[np.ndarray, "n 6"]:
    """The six coordinates of `_in_stance` between two stances.

    Relative to the plain curve, the foot is in front early in swing and behind late in swing, as in human gait;
    otherwise it would wait above the floor for the body, with a straight leg. The arc's height leaves more than 0.02 m
    below the toes, and the foot hangs while the shank is tilted forward. [judgement]
    """
    duration_s = after.start_s - before.stop_s
    s = (times - before.stop_s) / duration_s
    start = [part[0] for part in _in_stance(before, np.array([before.stop_s]))]
    stop = [part[0] for part in _in_stance(after, np.array([after.start_s]))]
    values = hermite(s, duration_s, start, stop)
    forward = commands.held(commands.forward, before.stop_s + 0.5 * duration_s)
    runs = recipe.gait == gait.RUN
    lift, dip = (0.07 + 0.015 * (forward - 2.0), 0.0) if runs else (0.075, 0.1 * max(forward, 0.0))  # [m], [rad]
    shift = (0.05 if runs else 0.03) * (_bump(s, 3, 5) - _bump(s, 5, 3))
    values[:, :2] += shift[:, None] * (stop[0][:2] - start[0][:2])
    values[:, 2] += lift * _bump(s, 3, 3)
    values[:, 4] += dip * _bump(s, 3, 4)
    return values


def _bump(s: np.ndarray, rise: int, fall: int) -> np.ndarray:
    """0 at both ends with two derivatives, 1 at its highest, s = rise/(rise+fall)."""
    top = rise / (rise + fall)
    return s**rise * (1.0 - s) ** fall / (top**rise * (1.0 - top) ** fall)
