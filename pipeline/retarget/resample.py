"""A human clip at another rate, by time."""

from __future__ import annotations

import dataclasses

from pipeline import time_series
from pipeline.clips.human_clip import HumanClip


def resampled(clip: HumanClip, fps: float) -> HumanClip:
    """The same motion at `fps`; positions linearly, orientations by slerp, contacts from the nearest frame."""
    if clip.fps == fps:
        return clip
    times_s = time_series.resample_times(clip.frame_count, clip.fps, fps)
    contacts = clip.contacts
    return dataclasses.replace(
        clip,
        fps=fps,
        body_pos_w=time_series.resample_linear(clip.body_pos_w, clip.fps, times_s),
        body_quat_w=time_series.resample_quat(clip.body_quat_w, clip.fps, times_s),
        contacts=None if contacts is None else time_series.resample_nearest(contacts, clip.fps, times_s),
    )
