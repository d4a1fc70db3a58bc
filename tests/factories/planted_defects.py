"""Defects put into sound human clips at random places; what was done is told, so that it can be looked for."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline import rotation
from pipeline.clips.human_clip import BODIES, HumanClip, body
from pipeline.repair.tree import PARENT, descendants, to_local

LIMBS: tuple[tuple[str, ...], ...] = (
    ("left_hip", "left_knee", "left_ankle", "left_toe"),
    ("right_hip", "right_knee", "right_ankle", "right_toe"),
    ("left_shoulder", "left_elbow", "left_wrist"),
    ("right_shoulder", "right_elbow", "right_wrist"),
)
MARGIN_S = 0.6
"""Defects keep away from the ends by this time [s]."""


@dataclass(frozen=True, kw_only=True)
class Planted:
    """A spoilt clip."""

    clip: HumanClip
    start: int
    stop: int
    """Frames [start, stop) that are spoilt; equal for a jump before `start`."""


def plant(kind: str, clip: HumanClip, rng: np.random.Generator, *, seconds: float | None = None) -> Planted:
    """`clip` with one defect of a kind of `KINDS`, somewhere, .03 to .25 s long or for `seconds`."""
    length = max(1, round((seconds if seconds is not None else rng.uniform(0.03, 0.25)) * clip.fps))
    margin = round(MARGIN_S * clip.fps)
    start = int(rng.integers(margin, clip.frame_count - margin - length))
    pos, quat = clip.body_pos_w.copy(), clip.body_quat_w.copy()
    stop = KINDS[kind](pos, quat, start, start + length, rng)
    return Planted(clip=dataclasses.replace(clip, body_pos_w=pos, body_quat_w=quat), start=start, stop=stop)


def worst_change(clip: HumanClip, planted: Planted) -> tuple[float, float]:
    """How far the defect moves any joint [m], and turns any body [rad]."""
    span = slice(planted.start, max(planted.stop, planted.start + 1))
    moved = np.linalg.norm(planted.clip.body_pos_w[span] - clip.body_pos_w[span], axis=-1)
    turned = rotation.angle_between(planted.clip.body_quat_w[span], clip.body_quat_w[span])
    return float(np.nan_to_num(moved, nan=np.inf).max()), float(np.nan_to_num(turned, nan=np.inf).max())


def _not_a_number(pos: np.ndarray, quat: np.ndarray, start: int, stop: int, rng: np.random.Generator) -> int:
    pos[start:stop], quat[start:stop] = np.nan, np.nan
    return stop


def _zeroed_joint(pos: np.ndarray, quat: np.ndarray, start: int, stop: int, rng: np.random.Generator) -> int:
    pos[start:stop, int(rng.integers(1, len(BODIES)))] = 0.0
    return stop


def _zeroed_limb(pos: np.ndarray, quat: np.ndarray, start: int, stop: int, rng: np.random.Generator) -> int:
    limb = [body(name) for name in LIMBS[int(rng.integers(len(LIMBS)))]]
    pos[start:stop, limb] = 0.0
    quat[start:stop, limb] = rotation.IDENTITY
    return stop


def _bind_pose_limb(pos: np.ndarray, quat: np.ndarray, start: int, stop: int, rng: np.random.Generator) -> int:
    """The rotations of one limb are zero: it sticks out sideways (arms) or hangs straight (legs)."""
    limb = LIMBS[int(rng.integers(len(LIMBS)))]
    out = rotation.from_axis_angle(np.array([1.0, 0.0, 0.0]), (1.0 if "left" in limb[0] else -1.0) * np.pi / 2)
    turns = {body(name): rotation.IDENTITY for name in limb}
    if "shoulder" in limb[0]:
        turns[body(limb[0])] = out
    _turn(pos, quat, slice(start, stop), turns)
    return stop


def _root_to_origin(pos: np.ndarray, quat: np.ndarray, start: int, stop: int, rng: np.random.Generator) -> int:
    """Tracking loss: everything in bind pose at the origin."""
    upright = pos[0] - pos[0, 0]
    pos[start:stop], quat[start:stop] = upright + np.array([0.0, 0.0, 0.1]), rotation.IDENTITY
    return stop


def _teleport(pos: np.ndarray, quat: np.ndarray, start: int, stop: int, rng: np.random.Generator) -> int:
    angle = rng.uniform(-np.pi, np.pi)
    pos[start:] += rng.uniform(0.15, 1.0) * np.array([np.cos(angle), np.sin(angle), 0.0])
    return start


def _heading_jump(pos: np.ndarray, quat: np.ndarray, start: int, stop: int, rng: np.random.Generator) -> int:
    turn = rotation.about_z(rng.choice([-1.0, 1.0]) * rng.uniform(np.deg2rad(15), np.pi / 2))
    centre = pos[start, 0] * [1.0, 1.0, 0.0]
    pos[start:] = rotation.rotate(turn, pos[start:] - centre) + centre
    quat[start:] = rotation.multiply(turn, quat[start:])
    return start


def _spike(pos: np.ndarray, quat: np.ndarray, start: int, stop: int, rng: np.random.Generator) -> int:
    """One joint is elsewhere for a frame."""
    away = rng.normal(size=3)
    pos[start, int(rng.integers(1, len(BODIES)))] += rng.uniform(0.05, 0.4) * away / np.linalg.norm(away)
    return start + 1


def _angle_spike(pos: np.ndarray, quat: np.ndarray, start: int, stop: int, rng: np.random.Generator) -> int:
    """One rotation jumps for a frame, as where an Euler angle wraps or a sign flips; what is below it follows."""
    index = int(rng.integers(1, len(BODIES)))
    turn = rotation.from_axis_angle(rotation.normalize(rng.normal(size=3)), rng.uniform(np.deg2rad(25), np.pi))
    local = to_local(pos, quat)[1][start, index]
    _turn(pos, quat, slice(start, start + 1), {index: rotation.multiply(local, turn)})
    return start + 1


def _frozen(pos: np.ndarray, quat: np.ndarray, start: int, stop: int, rng: np.random.Generator) -> int:
    pos[start:stop], quat[start:stop] = pos[start - 1], quat[start - 1]
    return stop


def _swapped_legs(pos: np.ndarray, quat: np.ndarray, start: int, stop: int, rng: np.random.Generator) -> int:
    left, right = ([body(name) for name in limb] for limb in LIMBS[:2])
    for values in (pos, quat):
        values[start:stop, left + right] = values[start:stop, right + left]
    return stop


def _turn(pos: np.ndarray, quat: np.ndarray, span: slice, turns: dict[int, np.ndarray]) -> None:
    """Give some bodies other rotations in their parents' frames; what hangs below them goes along."""
    offset, local = to_local(pos[span], quat[span])
    moved = sorted({index for root in turns for index in (root, *descendants(root))})
    for index in moved:
        parent = PARENT[index]
        pos[span, index] = pos[span, parent] + rotation.rotate(quat[span, parent], offset[:, index])
        quat[span, index] = rotation.multiply(quat[span, parent], turns.get(index, local[:, index]))


KINDS: dict[str, Callable[[np.ndarray, np.ndarray, int, int, np.random.Generator], int]] = {
    "not_a_number": _not_a_number,
    "zeroed_joint": _zeroed_joint,
    "zeroed_limb": _zeroed_limb,
    "bind_pose_limb": _bind_pose_limb,
    "root_to_origin": _root_to_origin,
    "teleport": _teleport,
    "heading_jump": _heading_jump,
    "spike": _spike,
    "angle_spike": _angle_spike,
    "frozen": _frozen,
    "swapped_legs": _swapped_legs,
}
