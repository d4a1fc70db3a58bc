"""Zero-phase smoothing of a stretch without cuts; limb bones keep their lengths."""

from __future__ import annotations

import dataclasses

from pipeline import time_series
from pipeline.clips.human_clip import HumanClip
from pipeline.repair.limbs import keep_lengths
from pipeline.repair.settings import SmoothSettings
from pipeline.repair.tree import bone_lengths


def smoothed(clip: HumanClip, skill: str, settings: SmoothSettings) -> HumanClip:
    """The clip low-passed, without lag. `skill` picks the cutoff: what is fast has faster parts."""
    cutoff_hz = settings.fast_cutoff_hz if skill in settings.fast_skills else settings.cutoff_hz
    lengths = bone_lengths(clip.body_pos_w)
    pos_w = time_series.smooth(clip.body_pos_w, clip.fps, cutoff_hz)
    return dataclasses.replace(
        clip,
        body_pos_w=keep_lengths(pos_w, lengths),
        body_quat_w=time_series.smooth_quat(clip.body_quat_w, clip.fps, cutoff_hz),
    )
