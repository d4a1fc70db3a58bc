"""Every lost sample of a clip made good, short gaps one way and longer ones another."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Bool

from pipeline import time_series
from pipeline.clips.human_clip import HumanClip
from pipeline.repair.defect import Findings
from pipeline.repair.fill import astray_bodies, fill, fill_limbs
from pipeline.repair.settings import FillSettings
from pipeline.repair.similar import fill_similar
from pipeline.repair.tree import bone_lengths


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
