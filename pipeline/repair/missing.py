"""Samples that are not there: not finite, at the origin, on top of their parent, no rotation."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from pipeline import rotation
from pipeline.clips.human_clip import HumanClip
from pipeline.repair.defect import Defect, names
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.tree import PARENT

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
