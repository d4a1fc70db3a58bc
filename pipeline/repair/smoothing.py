"""Zero-phase smoothing of a stretch without cuts; limb bones keep their lengths."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series
from pipeline.clips.human_clip import HumanClip
from pipeline.repair.settings import SmoothSettings
from pipeline.repair.tree import CHILDREN, LIMBS, Positions, bone_lengths


def keep_lengths(pos_w: Positions, lengths: Float[np.ndarray, "t 19"]) -> Positions:
    """Positions whose limb bones have `lengths` [m] (per frame and body; the bone to the body's parent).

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
    """The clip low-passed, without lag. `skill` picks the cutoff: what is fast has faster parts."""
    cutoff_hz = settings.fast_cutoff_hz if skill in settings.fast_skills else settings.cutoff_hz
    poses = np.concatenate([clip.body_pos_w, rotation.make_continuous(clip.body_quat_w)], axis=2)
    smooth = time_series.smooth(poses, clip.fps, cutoff_hz)
    return dataclasses.replace(
        clip,
        body_pos_w=keep_lengths(smooth[..., :3], bone_lengths(clip.body_pos_w)),
        body_quat_w=rotation.normalize(smooth[..., 3:]),
    )
