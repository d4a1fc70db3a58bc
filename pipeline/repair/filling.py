"""Every lost sample of a clip made good, short gaps one way and longer ones another."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation, time_series
from pipeline.clips.human_clip import HumanClip
from pipeline.repair.defect import Findings
from pipeline.repair.fill import astray_bodies, bridge, fill, fill_limbs
from pipeline.repair.settings import FillSettings
from pipeline.repair.tree import Orientations, Positions, bone_lengths

CONTEXT_S = 0.16
"""Time before and after a gap in which windows are compared [s]."""
MISS_CONTEXT_S = 0.08
"""Of it the part that what a window misses is bridged from [s]; longer than for a motion: it is small and noisy."""
NEAREST = 4
"""Windows that are averaged."""
APART_S = 0.1
"""Two of them are at least this far apart [s]; neighbours say the same."""
SAMPLES = 16
"""Frames of a window that are compared."""
LARGEST_MISS = 0.08
"""A window whose joints are further off than this on average is not similar [m]."""
VELOCITY_S = 0.1
"""Weight of a difference in the pelvis' velocity against one in place [m per m/s]."""


def fill_similar(
    pos_w: Positions,
    quat_w: Orientations,
    lost: Bool[np.ndarray, "t 19"],
    start: int,
    stop: int,
    fps: float,
) -> tuple[Float[np.ndarray, "gap 19 3"], Float[np.ndarray, "gap 19 4"]] | None:
    """Positions and orientations of frames [start, stop), every body; None where nothing is similar.

    The clip comes with all gaps bridged; `lost` says which of its samples were not there.
    """
    context = max(3, round(CONTEXT_S * fps))
    low, high = start - context, stop + context
    if low < 0 or high > len(pos_w):
        return None
    choices = _similar(pos_w, quat_w, lost, low, high, fps)
    if not choices:
        return None
    known = ~lost[low:high]
    made_pos, made_quat, weights = [], [], []
    for first, miss in choices:
        span = slice(first, first + high - low)
        pos, quat = _onto(pos_w[span], quat_w[span], pos_w[low:high], known)
        made_pos.append(pos)
        made_quat.append(_same_sign(quat, made_quat[0]) if made_quat else quat)
        weights.append(1.0 / (miss + 1e-3) ** 2)
    share = np.array(weights) / np.sum(weights)
    pos = np.tensordot(share, np.stack(made_pos), axes=1)
    quat = rotation.normalize(np.tensordot(share, np.stack(made_quat), axes=1))
    gap = np.zeros(high - low, dtype=bool)
    gap[context:-context] = True
    return _fitted(pos, pos_w[low:high], gap, fps)[gap], rotation.normalize(
        _fitted(quat, _same_sign(quat_w[low:high], quat), gap, fps)
    )[gap]


def _fitted(made: np.ndarray, target: np.ndarray, gap: Bool[np.ndarray, " m"], fps: float) -> np.ndarray:
    """`made` (m, ...) plus what it misses of `target` around the gap, bridged across it."""
    miss = (target - made).reshape(len(gap), -1)
    return made + bridge(miss, gap, fps, MISS_CONTEXT_S).reshape(made.shape)


def _same_sign(quat: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The same rotations, each on the side of `other`."""
    return np.where(np.sum(quat * other, axis=-1, keepdims=True) < 0.0, -quat, quat)


def _similar(
    pos_w: Positions, quat_w: Orientations, lost: Bool[np.ndarray, "t 19"], low: int, high: int, fps: float
) -> list[tuple[int, float]]:
    """First frames of the windows most like [low, high), with how far their joints are off [m]; best first."""
    length = high - low
    count = len(pos_w) - length + 1
    at = np.unique(np.linspace(0, length - 1, min(SAMPLES, length)).round().astype(int))
    pose = _poses(pos_w, quat_w, fps)
    known = ~lost[low:high]
    known = np.concatenate([known, known[:, :1]], axis=1)
    total, terms = np.zeros(count), 0
    for offset in at:
        bodies = np.flatnonzero(known[offset])
        if len(bodies):
            apart = pose[offset : offset + count][:, bodies] - pose[low + offset, bodies]
            total += np.sum(apart**2, axis=(1, 2))
            terms += len(bodies)
    if not terms:
        return []
    miss = np.sqrt(total / terms)
    spoilt = np.concatenate([[0], np.cumsum(lost.any(axis=1))])
    miss[(spoilt[length:] - spoilt[:-length]) > 0] = np.inf
    chosen: list[tuple[int, float]] = []
    for first in np.argsort(miss, kind="stable"):
        if miss[first] > LARGEST_MISS or len(chosen) == NEAREST:
            break
        if all(abs(int(first) - other) >= APART_S * fps for other, _ in chosen):
            chosen.append((int(first), float(miss[first])))
    return chosen


def _poses(pos_w: Positions, quat_w: Orientations, fps: float) -> Float[np.ndarray, "t 20 3"]:
    """Joints from the pelvis, the pelvis' height, and its velocity, in the frame of the heading."""
    ahead = rotation.rotate(quat_w[:, 0], np.array([1.0, 0.0, 0.0]))
    back = rotation.about_z(-np.arctan2(ahead[:, 1], ahead[:, 0]))
    joints = pos_w - pos_w[:, :1] * [1.0, 1.0, 0.0]
    velocity = np.gradient(pos_w[:, 0], axis=0) * fps * VELOCITY_S
    return rotation.rotate(back[:, None], np.concatenate([joints, velocity[:, None]], axis=1))


def _onto(
    pos: Positions, quat: Orientations, target: Positions, known: Bool[np.ndarray, "t 19"]
) -> tuple[Positions, Orientations]:
    """A window turned about the vertical and moved so that its joints lie on the `known` ones of `target`."""
    weight = known[..., None].astype(float)
    total = weight.sum()
    centre, goal = ((values * weight).sum(axis=(0, 1)) / total for values in (pos, target))
    a, b = (pos - centre) * weight, (target - goal) * weight
    cosine = np.sum(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1])
    sine = np.sum(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
    turn = rotation.about_z(float(np.arctan2(sine, cosine)))
    moved = rotation.rotate(turn, pos - centre) + np.array([goal[0], goal[1], centre[2]])
    return moved, rotation.multiply(turn, quat)


def filled(clip: HumanClip, findings: Findings, dropped: Bool[np.ndarray, " t"], settings: FillSettings) -> HumanClip:
    """The clip without lost samples; frames that are `dropped` hold something finite and are not to be used.

    Gaps longer than `short_gap_s` are filled from similar moments of the clip where it has them. Limb bones have
    the clip's median lengths wherever a position was filled.
    """
    lost_pos, lost_rot = findings.lost_pos, findings.lost_rot
    if not findings.lost.any():
        return clip
    pos_w, quat_w = fill(clip.body_pos_w, clip.body_quat_w, lost_pos, lost_rot, clip.fps)
    astray = astray_bodies(lost_pos, lost_rot, clip.body_quat_w)
    lost = findings.lost | astray
    new_pos, new_quat = pos_w.copy(), quat_w.copy()
    for start, stop in time_series.runs(lost.any(axis=1) & ~dropped):
        if not settings.short_gap_s < (stop - start) / clip.fps <= settings.longest_gap_s + 1e-9:
            continue
        made = fill_similar(pos_w, quat_w, lost, start, stop, clip.fps)
        if made is not None:
            span = slice(start, stop)
            new_pos[span] = np.where((lost_pos | astray)[span, :, None], made[0], pos_w[span])
            new_quat[span] = np.where((lost_rot | astray)[span, :, None], made[1], quat_w[span])
    good = ~lost.any(axis=1)
    if good.any():
        new_pos = fill_limbs(new_pos, lost_pos | astray, np.median(bone_lengths(clip.body_pos_w[good]), axis=0))
    return dataclasses.replace(clip, body_pos_w=new_pos, body_quat_w=new_quat)
