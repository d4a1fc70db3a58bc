"""Zero-phase smoothing of a stretch without cuts; limb bones keep their lengths."""

from __future__ import annotations

import dataclasses

import numpy as np

from pipeline import rotation, time_series
from pipeline.clips.human_clip import HumanClip
from pipeline.repair.limbs import keep_lengths
from pipeline.repair.settings import SmoothSettings
from pipeline.repair.tree import bone_lengths


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
