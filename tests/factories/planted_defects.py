"""Defects put into sound human clips at random places; what was done is told, so that it can be looked for."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline import rotation
from pipeline.clips.human_clip import HumanClip
from pipeline.repair.tree import to_local
from tests.factories import pose_defects as pose
from tests.factories import root_defects as root
from tests.factories.defect_draft import Draft

MARGIN_S = 0.6
"""Defects keep away from the ends by this time [s]."""
MATTERS_M, MATTERS_RAD = 0.03, np.deg2rad(10.0)
"""What makes a defect of the pose one that matters: a joint is this far from the truth [m], [rad]."""
LEAST_HELD = 3
"""Frames from which a joint that is held, and should move, matters."""
MOVES_M_S, MOVES_RAD_S = 0.1, 0.3
"""A joint that should go or turn at this speed on average moves [m/s], [rad/s]."""


@dataclass(frozen=True, kw_only=True)
class Kind:
    """How one kind of defect is planted."""

    change: Callable[[Draft], None]
    seconds: tuple[float, float] = (0.03, 0.25)
    """Shortest and longest [s]; lengths between are as likely by their logarithm."""


@dataclass(frozen=True, kw_only=True)
class Planted:
    """A spoilt clip."""

    clip: HumanClip
    start: int
    stop: int
    """Frames [start, stop) that are spoilt; equal for a jump before `start`."""
    strength: float
    """How much it matters: 1 is the least that does."""
    size: float | None = None
    """What was added to a floor's height, or over the clip to its drift [m]."""
    first: int
    last: int
    """First and last frame in which it matters, for a defect of the pose; else `start` and `stop` - 1."""


def plant(kind: str, clip: HumanClip, rng: np.random.Generator, *, seconds: float | None = None) -> Planted:
    """`clip` with one defect of a kind of `KINDS`, somewhere, of a random strength; its length may be given."""
    chosen = KINDS[kind]
    drawn_s = float(np.exp(rng.uniform(*np.log(chosen.seconds))))
    length = max(1, round((seconds if seconds is not None else drawn_s) * clip.fps))
    margin = min(round(MARGIN_S * clip.fps), (clip.frame_count - 4) // 4)
    length = min(length, clip.frame_count - 2 * margin - 1)
    start = int(rng.integers(margin, clip.frame_count - margin - length))
    draft = Draft.of(clip, start, start + length, rng)
    chosen.change(draft)
    spoilt = dataclasses.replace(clip, body_pos_w=draft.pos, body_quat_w=draft.quat)
    if draft.strength is not None:
        return Planted(
            clip=spoilt,
            start=draft.start,
            stop=draft.stop,
            strength=draft.strength,
            size=draft.size_m,
            first=draft.start,
            last=max(draft.stop - 1, draft.start),
        )
    apart = deviation(clip, spoilt)[draft.start : draft.stop]
    matters = draft.start + np.flatnonzero(apart >= 1.0)
    long_enough = draft.stop - draft.start >= LEAST_HELD
    strength = 0.0 if draft.holds and not long_enough else float(apart.max())
    if long_enough and draft.still:
        strength = max(strength, min(1.0, missing_motion(clip, draft)))
    return Planted(
        clip=spoilt,
        start=draft.start,
        stop=draft.stop,
        strength=strength,
        first=int(matters[0]) if len(matters) else draft.start,
        last=int(matters[-1]) if len(matters) else draft.stop - 1,
    )


def missing_motion(clip: HumanClip, draft: Draft) -> float:
    """Mean speed of the fastest of the bodies that are held, as a multiple of that of a body that moves."""
    span = slice(draft.start - 1, draft.stop)
    pos_w, quat_w, bodies = clip.body_pos_w[span], clip.body_quat_w[span], list(draft.still)
    if draft.still_in_world:
        way = np.linalg.norm(np.diff(pos_w[:, bodies], axis=0), axis=-1)
    else:
        local = to_local(pos_w, quat_w)[1][:, bodies]
        way = rotation.angle_between(local[:-1], local[1:])
    speed = float(way.sum(axis=0).max()) * clip.fps / (draft.stop - draft.start)
    return speed / (MOVES_M_S if draft.still_in_world else MOVES_RAD_S)


def deviation(clip: HumanClip, spoilt: HumanClip) -> np.ndarray:
    """How far the worst joint of each frame (t,) is from the truth, as a multiple of what matters."""
    moved = np.linalg.norm(spoilt.body_pos_w - clip.body_pos_w, axis=-1) / MATTERS_M
    norm = np.linalg.norm(spoilt.body_quat_w, axis=-1)
    turned = rotation.angle_between(spoilt.body_quat_w, clip.body_quat_w) / MATTERS_RAD
    turned = np.where(np.abs(norm - 1.0) < 0.5, turned, np.inf)
    return np.nan_to_num(np.maximum(moved, turned), nan=np.inf).max(axis=1)


KINDS: dict[str, Kind] = {
    "missing_frames": Kind(change=pose.missing_frames, seconds=(0.02, 1.0)),
    "zeroed_frames": Kind(change=pose.zeroed_frames, seconds=(0.02, 1.0)),
    "joint_dropout": Kind(change=pose.joint_dropout, seconds=(0.02, 1.0)),
    "limb_dropout": Kind(change=pose.limb_dropout, seconds=(0.02, 1.0)),
    "body_dropout": Kind(change=pose.body_dropout, seconds=(0.02, 1.0)),
    "root_teleport": Kind(change=root.teleport, seconds=(0.02, 1.0)),
    "swapped_sides": Kind(change=pose.swapped_sides, seconds=(0.05, 1.5)),
    "spike": Kind(change=pose.spike, seconds=(0.008, 0.05)),
    "noise": Kind(change=pose.noise, seconds=(0.1, 1.0)),
    "sign_flip": Kind(change=pose.blended_sign_flip, seconds=(0.008, 0.05)),
    "euler_wrap": Kind(change=pose.blended_euler_wrap, seconds=(0.008, 0.08)),
    "frozen": Kind(change=pose.frozen, seconds=(0.03, 1.0)),
    "doubled_stretch": Kind(change=pose.doubled_stretch, seconds=(0.2, 1.0)),
    "opening_pose": Kind(change=pose.opening_pose, seconds=(0.008, 0.05)),
    "origin_loss": Kind(change=pose.origin_loss, seconds=(0.03, 1.5)),
    "heading_jump": Kind(change=root.heading_jump),
    "foot_skate": Kind(change=root.foot_skate, seconds=(1.0, 6.0)),
    "floor_offset": Kind(change=root.floor_offset),
    "floor_drift": Kind(change=root.floor_drift),
}
"""Kinds of defects of a clip. A wrong rate, frames stored twice and a wrong unit are defects of a file."""
