"""Run all detectors in order, each on the clip with the defects found so far interpolated."""

import dataclasses

import numpy as np

from pipeline import rotation
from pipeline.clips.human_clip import PARENT, HumanClip
from pipeline.repair.defect import Defect, Findings, spans
from pipeline.repair.fill import fill
from pipeline.repair.frozen import find_frozen
from pipeline.repair.jumps import find_jumps, joined
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.shaking import find_noise
from pipeline.repair.swapped import find_broken_bones, find_swapped, swap_back
from pipeline.repair.tree import BodyMask
from pipeline.repair.unsteadiness import MotionFeatures, find_spikes

MOST_LOOKS = 4
"""Most iterations of the spike detector: a large spike hides smaller ones beside it."""

BESIDE = 3
"""Most frames between a frozen and a shaking stretch that count as adjacent."""


NEAR = 1e-6
"""Distance to the origin or the parent below which a body counts as zeroed [m]; real data have more noise."""
SHORTEST_BONE = 0.02
"""Bone length below which a body coincides with its parent by the skeleton's design [m]."""


def detect(clip: HumanClip, settings: DetectionSettings) -> tuple[HumanClip, Findings]:
    """The clip with exchanged sides restored, and all other defects in it."""
    findings = Findings(frame_count=clip.frame_count)
    findings.add(find_missing(clip, settings))
    features = _bridged(clip, findings)
    swapped = find_swapped(features.pos_w, clip.fps)
    if swapped:
        findings.add(swapped)
        pos_w, quat_w = swap_back(clip.body_pos_w, swapped), swap_back(clip.body_quat_w, swapped)
        clip = dataclasses.replace(clip, body_pos_w=pos_w, body_quat_w=quat_w)
        findings.lost_pos, findings.lost_rot = (
            swap_back(lost, swapped) for lost in (findings.lost_pos, findings.lost_rot)
        )
        features = _bridged(clip, findings)
    for find in (_frozen_and_shaking, _broken_bones):
        found = find(clip, features, findings, settings)
        if found:
            findings.add(found)
            features = _bridged(clip, findings)
    jumps = joined(find_jumps(features, findings.lost, clip.fps, settings), findings.defects)
    findings.add(jumps)
    for _ in range(MOST_LOOKS):
        features = _bridged(clip, findings) if jumps else features
        jumps = find_spikes(features, findings.lost | findings.beside_cuts, clip.fps, settings)
        if not jumps:
            break
        findings.add(jumps)
    return clip, findings


def _frozen_and_shaking(
    clip: HumanClip, features: MotionFeatures, findings: Findings, settings: DetectionSettings
) -> list[Defect]:
    """Frozen stretches, and shaking in the clip with these interpolated.

    A jump between a rest and a shaking stretch is caused by the shaking, so it does not show that the rest is frozen.
    """
    frozen = _new(find_frozen(features, findings.lost, clip.fps, settings), findings)
    if frozen:
        features = _bridged(clip, findings.with_more(frozen))
    shaking = _new(find_noise(features, clip.fps, settings), findings)
    if not frozen or not shaking:
        return frozen + shaking
    kept = [one for one in frozen if not any(_touches(one, other) for other in shaking)]
    if len(kept) == len(frozen):
        return frozen + shaking
    features = _bridged(clip, findings.with_more(kept))
    return kept + _new(find_noise(features, clip.fps, settings), findings)


def _broken_bones(
    clip: HumanClip, features: MotionFeatures, findings: Findings, settings: DetectionSettings
) -> list[Defect]:
    return _new(find_broken_bones(features.pos_w, findings.lost, settings), findings)


def _touches(one: Defect, shaking: Defect) -> bool:
    """Whether the jump that marks a joint as frozen is next to a shaking stretch."""
    if one.code == "dropout":
        return abs(one.start - shaking.stop) <= BESIDE
    return one.code == "frozen_joint" and abs(one.stop - shaking.start) <= BESIDE


def _bridged(clip: HumanClip, findings: Findings) -> MotionFeatures:
    """The clip with all lost samples interpolated, however long the gaps, as input for the next detector."""
    pos_w, quat_w = fill(clip.body_pos_w, clip.body_quat_w, findings.lost_pos, findings.lost_rot, clip.fps)
    return MotionFeatures(pos_w=pos_w, quat_w=quat_w)


def _new(defects: list[Defect], findings: Findings) -> list[Defect]:
    """Defects with samples that were not lost before: an interpolated gap at the clip's end is not frozen."""
    lost = findings.lost
    return [one for one in defects if not lost[one.start : one.stop][:, list(one.bodies)].all()]


def find_missing(clip: HumanClip, settings: DetectionSettings) -> list[Defect]:
    """NaN and infinite samples (`missing`), zeroed joints (`zeroed`), non-unit quaternions (`no_rotation`)."""
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


def _zeroed(pos_w: np.ndarray) -> BodyMask:
    """Bodies at the world's origin, or at their parent's position although their bone is longer."""
    at_origin = rotation.length(pos_w) < NEAR
    at_origin[at_origin[:, 0]] = True
    bone = np.full(pos_w.shape[:2], np.inf)
    bone[:, 1:] = rotation.length(pos_w[:, 1:] - pos_w[:, list(PARENT[1:])])
    known = np.isfinite(bone) & ~at_origin
    usual = np.array(
        [np.median(column[valid]) if valid.any() else 0.0 for column, valid in zip(bone.T, known.T, strict=True)]
    )
    with np.errstate(invalid="ignore"):
        on_parent = (bone < NEAR) & (usual > SHORTEST_BONE)
    return at_origin | on_parent
