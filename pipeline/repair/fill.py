"""Fill lost samples: short gaps by a polynomial, longer ones from similar motion; limbs keep their lengths."""

import dataclasses
import functools

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation, time_series
from pipeline.clips.human_clip import PARENT, HumanClip
from pipeline.repair.defect import Findings
from pipeline.repair.settings import FillSettings, SmoothSettings
from pipeline.repair.tree import (
    CHILDREN,
    LIMBS,
    BodyMask,
    FrameMask,
    Orientations,
    PerBody,
    Positions,
    bone_lengths,
    descendants,
    parent_pose,
    to_local,
)

CONTEXT_S = 0.055
"""Time before and after a gap whose samples determine the polynomial [s]."""
UNIT_TOLERANCE = 0.01
"""Deviation of a quaternion's norm from 1 up to which it affected the poses of the bodies below it."""
DEGREE = 5
"""Degree of the polynomial: position, velocity and acceleration at both ends."""


def fill(
    pos_w: Positions, quat_w: Orientations, lost_pos: BodyMask, lost_rot: BodyMask, fps: float
) -> tuple[Positions, Orientations]:
    """Interpolate the lost samples; the others do not change.

    Gaps get a polynomial of degree 5 through the frames around them, in the world frame. Where only a body's
    orientation was lost, the bodies below it are wrong as well: they keep their poses in their parents' frames.
    Gaps at the ends of the clip repeat the nearest sample. A body that is lost throughout is not changed.
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


def bridge(
    values: Float[np.ndarray, "t n"], lost: FrameMask, fps: float, context_s: float = CONTEXT_S
) -> Float[np.ndarray, "t n"]:
    """Replace the frames of `values` marked `lost`, from the valid frames within `context_s` of each run."""
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
    """Matrix from the values at frames `before` and `after` to frames 0 ... `count` - 1; exact at both neighbours."""
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


def astray_bodies(lost_pos: np.ndarray, lost_rot: np.ndarray, quat_w: Orientations) -> BodyMask:
    """Bodies below a body of which only the orientation was lost, unless lost themselves.

    A quaternion that is NaN or not unit had no effect on the bodies below.
    """
    astray = np.zeros_like(lost_pos)
    turned = lost_rot & ~lost_pos
    if turned.any():
        turned &= np.abs(np.linalg.norm(quat_w, axis=-1) - 1.0) < UNIT_TOLERANCE
    for index in np.flatnonzero(turned.any(axis=0)).tolist():
        astray[:, list(descendants(index))] |= turned[:, index, None]
    return astray


def _unit(quat_w: Orientations) -> Orientations:
    """Unit quaternions; the identity for NaN or zero."""
    norm = np.linalg.norm(quat_w, axis=-1, keepdims=True)
    sound = np.isfinite(norm) & (norm > 0.0)
    return np.where(sound, quat_w / np.where(sound, norm, 1.0), rotation.IDENTITY)


WINDOW_S = 0.16
"""Time before and after a gap in which windows are compared [s]."""
MISS_CONTEXT_S = 0.08
"""Time around a gap from which a window's residual, which is noisy, is interpolated [s]."""
NEAREST = 4
"""Number of most similar windows that are averaged."""
APART_S = 0.1
"""Least time between two of these windows [s]; adjacent windows are redundant."""
SAMPLES = 16
"""Number of frames of a window that are compared."""
LARGEST_MISS = 0.08
"""Mean joint distance above which a window is not similar [m]."""
VELOCITY_S = 0.1
"""Weight of a pelvis velocity difference relative to a position difference [m per m/s]."""


def fill_similar(
    pos_w: Positions, quat_w: Orientations, lost: BodyMask, start: int, stop: int, fps: float
) -> tuple[Float[np.ndarray, "gap 19 3"], Float[np.ndarray, "gap 19 4"]] | None:
    """Positions and orientations of all bodies for frames [start, stop); None if no window is similar.

    The clip has all gaps interpolated; `lost` marks the interpolated samples.
    """
    context = max(3, round(WINDOW_S * fps))
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
    pos = _fitted(pos, pos_w[low:high], gap, fps)
    quat = rotation.normalize(_fitted(quat, _same_sign(quat_w[low:high], quat), gap, fps))
    return pos[gap], quat[gap]


def _fitted(made: np.ndarray, target: np.ndarray, gap: Bool[np.ndarray, " m"], fps: float) -> np.ndarray:
    """`made` (m, ...) plus its residual to `target` around the gap, interpolated across the gap."""
    miss = (target - made).reshape(len(gap), -1)
    return made + bridge(miss, gap, fps, MISS_CONTEXT_S).reshape(made.shape)


def _same_sign(quat: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The same rotations with the sign that is closer to `other`."""
    return np.where(np.sum(quat * other, axis=-1, keepdims=True) < 0.0, -quat, quat)


def _similar(
    pos_w: Positions, quat_w: Orientations, lost: BodyMask, low: int, high: int, fps: float
) -> list[tuple[int, float]]:
    """First frames of the windows most similar to [low, high) and their mean joint distance [m]; best first."""
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
    """Joint positions relative to the pelvis, pelvis height and pelvis velocity, in the heading frame."""
    forward = rotation.rotate(quat_w[:, 0], np.array([1.0, 0.0, 0.0]))
    back = rotation.about_z(-np.arctan2(forward[:, 1], forward[:, 0]))
    joints = pos_w - pos_w[:, :1] * [1.0, 1.0, 0.0]
    velocity = np.gradient(pos_w[:, 0], axis=0) * fps * VELOCITY_S
    return rotation.rotate(back[:, None], np.concatenate([joints, velocity[:, None]], axis=1))


def _onto(pos: Positions, quat: Orientations, target: Positions, known: BodyMask) -> tuple[Positions, Orientations]:
    """Align a window with the `known` joints of `target` by a yaw rotation and a translation."""
    weight = known[..., None].astype(float)
    total = weight.sum()
    centre, goal = ((values * weight).sum(axis=(0, 1)) / total for values in (pos, target))
    a, b = (pos - centre) * weight, (target - goal) * weight
    cosine = np.sum(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1])
    sine = np.sum(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
    turn = rotation.about_z(float(np.arctan2(sine, cosine)))
    moved = rotation.rotate(turn, pos - centre) + np.array([goal[0], goal[1], centre[2]])
    return moved, rotation.multiply(turn, quat)


def filled(clip: HumanClip, findings: Findings, dropped: FrameMask, settings: FillSettings) -> HumanClip:
    """The clip without lost samples; `dropped` frames have finite values but must not be used.

    Gaps longer than `short_gap_s` are filled from similar motion of the same clip if there is any. Limb bones have
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
    good, moved = ~lost.any(axis=1), (lost_pos | astray).any(axis=1)
    if good.any() and moved.any():
        lengths = np.median(bone_lengths(clip.body_pos_w[good]), axis=0)
        new_pos[moved] = keep_lengths(new_pos[moved], np.broadcast_to(lengths, (int(moved.sum()), len(PARENT))))
    return dataclasses.replace(clip, body_pos_w=new_pos, body_quat_w=new_quat)


def keep_lengths(pos_w: Positions, lengths: PerBody) -> Positions:
    """Move joints so that limb bones have `lengths` [m] (per frame and body; the bone to the body's parent).

    Knees and elbows move in their limb's plane; an ankle or wrist moves only where the limb is too
    short to reach it; the ball of the foot follows its ankle.
    """
    result = pos_w.copy()
    for upper, middle, lower in LIMBS:
        joint, end = _two_bones(
            result[:, upper], result[:, middle], result[:, lower], lengths[:, middle], lengths[:, lower]
        )
        for toe in CHILDREN[lower]:
            result[:, toe] = end + lengths[:, toe, None] * rotation.normalize(result[:, toe] - result[:, lower])
        result[:, middle], result[:, lower] = joint, end
    return result


def _two_bones(
    upper_w: np.ndarray, middle_w: np.ndarray, lower_w: np.ndarray, first: np.ndarray, second: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Middle and lower joint (t, 3) of a limb with bones `first` and `second` (t,), bent the way `middle_w` is."""
    reach = lower_w - upper_w
    distance = np.linalg.norm(reach, axis=-1)
    allowed = np.clip(distance, np.abs(first - second), first + second)
    along = rotation.normalize(reach)
    out = middle_w - upper_w
    out = rotation.normalize(out - along * np.sum(out * along, axis=-1, keepdims=True))
    share = (first**2 - second**2 + allowed**2) / (2.0 * np.where(allowed > 0.0, allowed, 1.0))
    height = np.sqrt(np.maximum(first**2 - share**2, 0.0))
    return upper_w + along * share[:, None] + out * height[:, None], upper_w + along * allowed[:, None]


def smoothed(clip: HumanClip, skill: str, settings: SmoothSettings) -> HumanClip:
    """Low-pass the clip with zero phase. `skill` selects the cutoff, which is higher for fast skills."""
    cutoff_hz = settings.fast_cutoff_hz if skill in settings.fast_skills else settings.cutoff_hz
    poses = np.concatenate([clip.body_pos_w, rotation.make_continuous(clip.body_quat_w)], axis=2)
    smooth = time_series.smooth(poses, clip.fps, cutoff_hz)
    return dataclasses.replace(
        clip,
        body_pos_w=keep_lengths(smooth[..., :3], bone_lengths(clip.body_pos_w)),
        body_quat_w=rotation.normalize(smooth[..., 3:]),
    )
