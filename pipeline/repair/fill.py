"""Gaps in a clip filled from their surroundings, parents first, limbs kept at their lengths."""

from __future__ import annotations

import functools

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation, time_series
from pipeline.clips.human_clip import HumanClip
from pipeline.repair.defect import Defect, names
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.smoothing import keep_lengths
from pipeline.repair.tree import PARENT, Orientations, Positions, descendants, parent_pose, to_local

NEAR = 1e-6
"""A body this close to the origin or its parent lies on it [m]: real data have more noise."""
SHORTEST_BONE = 0.02
"""Bodies that are closer to their parent than this throughout the clip are so by design [m]."""


def find_missing(clip: HumanClip, settings: DetectionSettings) -> list[Defect]:
    """NaN and infinite samples (`missing`), zeroed joints (`zeroed`), no rotations (`no_rotation`)."""
    pos_w, quat_w = clip.body_pos_w, clip.body_quat_w
    missing_pos = np.any(~np.isfinite(pos_w), axis=-1)
    missing_rot = np.any(~np.isfinite(quat_w), axis=-1)
    missing = np.logical_or(missing_pos, missing_rot)
    zeroed = _zeroed(np.where(missing_pos[..., None], np.nan, pos_w))
    norm = np.linalg.norm(np.where(missing_rot[..., None], 1.0, quat_w), axis=-1)
    no_rotation = ~missing_rot & (np.abs(np.where(missing_rot, 1.0, norm) - 1.0) > settings.quat_norm_change)
    return (
        spans("missing", "{names} missing (not a number)", missing, pos=missing_pos, rot=missing_rot)
        + spans("zeroed", "{names} at zero", zeroed, pos=zeroed, rot=zeroed)
        + spans("no_rotation", "quaternion of {names} is not unit", no_rotation, pos=None, rot=no_rotation)
    )


def spans(
    code: str, text: str, mask: Bool[np.ndarray, "t 19"], *, pos: np.ndarray | None, rot: np.ndarray | None
) -> list[Defect]:
    """A defect for each run of frames in which the same bodies are marked in `mask`."""
    defects = []
    marked = np.flatnonzero(mask.any(axis=1))
    if not len(marked):
        return []
    changes = np.flatnonzero((np.diff(marked) > 1) | (mask[marked[1:]] != mask[marked[:-1]]).any(axis=1)) + 1
    for group in np.split(marked, changes):
        start, stop = int(group[0]), int(group[-1]) + 1
        bodies = tuple(int(index) for index in np.flatnonzero(mask[start]))
        defect = Defect(
            code=code,
            text=text.format(names=names(bodies)),
            start=start,
            stop=stop,
            bodies=bodies,
            pos=pos is not None and bool(pos[start:stop].any()),
            rot=rot is not None and bool(rot[start:stop].any()),
        )
        defects.append(defect)
    return defects


def _zeroed(pos_w: np.ndarray) -> Bool[np.ndarray, "t 19"]:
    """Bodies at the world's origin, or on their parent although their bone has a length."""
    at_origin = rotation.length(pos_w) < NEAR
    at_origin[at_origin[:, 0]] = True
    bone = np.full(pos_w.shape[:2], np.inf)
    bone[:, 1:] = rotation.length(pos_w[:, 1:] - pos_w[:, list(PARENT[1:])])
    known = np.isfinite(bone) & ~at_origin
    usual = np.array(
        [np.median(column[seen]) if seen.any() else 0.0 for column, seen in zip(bone.T, known.T, strict=True)]
    )
    with np.errstate(invalid="ignore"):
        on_parent = (bone < NEAR) & (usual > SHORTEST_BONE)
    return at_origin | on_parent


CONTEXT_S = 0.055
"""Time on either side that a gap is bridged from [s]."""
UNIT_TOLERANCE = 0.01
"""How far from 1 the length of a quaternion may be that bodies below it have followed."""
DEGREE = 5
"""Of the polynomial: place, speed and acceleration of both sides."""


def fill(
    pos_w: Positions,
    quat_w: Orientations,
    lost_pos: Bool[np.ndarray, "t 19"],
    lost_rot: Bool[np.ndarray, "t 19"],
    fps: float,
) -> tuple[Positions, Orientations]:
    """The clip without its lost samples; the others do not change.

    A polynomial of degree 5 through the frames around a gap, in the world. Where only a body's orientation
    was lost, the bodies below it went astray with it: they keep their poses in their parents' frames.
    Gaps at the ends hold the nearest sample. A body that is lost throughout stays as it is.
    """
    if not (lost_pos.any() or lost_rot.any()):
        return pos_w.copy(), _unit(quat_w)
    astray = astray_bodies(lost_pos, lost_rot, quat_w)
    offset, turn = to_local(np.nan_to_num(pos_w), _unit(quat_w))
    new_pos, new_quat = np.where(lost_pos[..., None], np.nan_to_num(pos_w), pos_w), _unit(quat_w)
    for index in range(len(PARENT)):
        moved = astray[:, index]
        if moved.any():
            parent_pos, parent_quat = (values[moved, index] for values in parent_pose(new_pos, new_quat))
            new_pos[moved, index] = parent_pos + rotation.rotate(parent_quat, offset[moved, index])
            new_quat[moved, index] = rotation.multiply(parent_quat, turn[moved, index])
        new_pos[:, index] = bridge(new_pos[:, index], lost_pos[:, index], fps)
        if lost_rot[:, index].any():
            good = ~lost_rot[:, index]
            signed = new_quat[:, index].copy()
            signed[good] = rotation.make_continuous(signed[good])
            new_quat[:, index] = rotation.normalize(bridge(signed, lost_rot[:, index], fps))
    return new_pos, new_quat


def fill_limbs(pos_w: Positions, lost_pos: Bool[np.ndarray, "t 19"], lengths: Float[np.ndarray, " 19"]) -> Positions:
    """Positions with the limb bones of the frames in which something was lost brought to `lengths` [m]."""
    frames = lost_pos.any(axis=1)
    result = pos_w.copy()
    if frames.any():
        result[frames] = keep_lengths(pos_w[frames], np.broadcast_to(lengths, (int(frames.sum()), len(PARENT))))
    return result


def bridge(
    values: Float[np.ndarray, "t n"], lost: Bool[np.ndarray, " t"], fps: float, context_s: float = CONTEXT_S
) -> Float[np.ndarray, "t n"]:
    """`values` with the frames marked `lost` made from the good ones within `context_s` of each run."""
    result = values.copy()
    good = np.flatnonzero(~lost)
    if not lost.any() or not len(good):
        return result
    count = max(3, round(context_s * fps))
    for start, stop in time_series.runs(lost):
        before = good[good < start][-count:]
        after = good[good >= stop][:count]
        result[start:stop] = _through(values, before, after, np.arange(start, stop))
    return result


def _through(values: np.ndarray, before: np.ndarray, after: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Values (m, n) at `frames`, by a polynomial through the frames `before` and `after` the gap."""
    if not len(before) or not len(after):
        return np.repeat(values[[after[0] if len(after) else before[-1]]], len(frames), axis=0)
    zero = int(frames[0])
    operator = _operator(tuple((before - zero).tolist()), tuple((after - zero).tolist()), len(frames))
    return operator @ values[np.concatenate([before, after])]


@functools.lru_cache(maxsize=256)
def _operator(before: tuple[int, ...], after: tuple[int, ...], count: int) -> Float[np.ndarray, "m known"]:
    """What the values at frames 0 to `count` - 1 are in those `before` and `after`; exact at both neighbours."""
    known, frames = np.array(before + after), np.arange(count)
    centre, half = (before[-1] + after[0]) / 2.0, (after[0] - before[-1]) / 2.0
    degree = min(DEGREE, len(known) - 1)

    def basis(at: np.ndarray) -> np.ndarray:
        return np.polynomial.chebyshev.chebvander((at - centre) / half, degree)

    weight = 1.0 / np.maximum(np.abs(known - centre) / half, 1.0)[:, None]
    solution = np.linalg.pinv(basis(known) * weight) * weight.T
    edges = [len(before) - 1, len(before)]
    miss = np.eye(len(known))[edges] - basis(known[edges]) @ solution
    share = ((frames - centre) / half + 1.0)[:, None] / 2.0
    return basis(frames) @ solution + miss[:1] * (1.0 - share) + miss[1:] * share


def astray_bodies(lost_pos: np.ndarray, lost_rot: np.ndarray, quat_w: Orientations) -> Bool[np.ndarray, "t 19"]:
    """Bodies that hang below a body of which only the orientation was lost, unless lost themselves.

    An orientation that is no rotation (not a number, not unit) has led nobody astray.
    """
    astray = np.zeros_like(lost_pos)
    turned = lost_rot & ~lost_pos
    if turned.any():
        turned &= np.abs(np.linalg.norm(quat_w, axis=-1) - 1.0) < UNIT_TOLERANCE
    for index in np.flatnonzero(turned.any(axis=0)).tolist():
        astray[:, list(descendants(index))] |= turned[:, index, None]
    return astray


def _unit(quat_w: Orientations) -> Orientations:
    """Unit quaternions; the identity where there is none."""
    norm = np.linalg.norm(quat_w, axis=-1, keepdims=True)
    sound = np.isfinite(norm) & (norm > 0.0)
    return np.where(sound, quat_w / np.where(sound, norm, 1.0), rotation.IDENTITY)
