"""Joints that are in the wrong place because bones do not have their length."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from pipeline.repair.defect import Defect
from pipeline.repair.missing import spans
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.tree import CHILDREN, LIMB_ENDS, PARENT, Positions, bone_lengths

SMALLEST_CHANGE = 0.01
"""A change of length that is always allowed [m]: 5 % of a foot is less than marker noise."""


def find_broken_bones(pos_w: Positions, lost: Bool[np.ndarray, "t 19"], settings: DetectionSettings) -> list[Defect]:
    """Frames in which a bone's length is off the clip's median (`bone_length`), with the joint that is to blame.

    The median is that of frames of which nothing is `lost`.
    """
    lengths = bone_lengths(pos_w)
    seen = ~lost.any(axis=1)
    median = np.median(lengths[seen] if seen.any() else lengths, axis=0)
    share = np.full(len(PARENT), settings.loose_bone_change)
    share[list(LIMB_ENDS)] = settings.bone_change
    broken = np.abs(lengths - median) > np.maximum(share * median, SMALLEST_CHANGE)
    broken[:, 0] = False
    blamed = np.zeros_like(broken)
    frames = np.flatnonzero(broken.any(axis=1))
    patterns, which = np.unique(broken[frames], axis=0, return_inverse=True) if len(frames) else (broken[:0], frames)
    for number, pattern in enumerate(patterns):
        blamed[frames[which.reshape(-1) == number, None], _to_blame(pattern)] = True
    limit = f"{{names}} off: a bone's length differs by more than {settings.bone_change:.0%} from the clip's median"
    return spans("bone_length", limit, blamed, pos=blamed, rot=blamed)


def _to_blame(pattern: Bool[np.ndarray, " 19"]) -> list[int]:
    """The fewest joints that touch all broken bones; of equals the one with all bones broken, then the lower."""
    broken = {index for index in range(len(pattern)) if pattern[index]}
    chosen = []
    while broken:
        touched = {index: broken & {index, *CHILDREN[index]} for index in range(len(PARENT))}
        degree = {index: len(CHILDREN[index]) + (PARENT[index] >= 0) for index in range(len(PARENT))}
        best = max(touched, key=lambda index: (len(touched[index]), len(touched[index]) / degree[index], index))
        chosen.append(best)
        broken -= touched[best]
    return chosen
