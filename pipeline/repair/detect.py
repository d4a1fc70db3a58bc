"""All detectors in order, each on a clip in which what was found before is bridged."""

from __future__ import annotations

import dataclasses

from pipeline.clips.human_clip import HumanClip
from pipeline.repair.defect import Defect, Findings
from pipeline.repair.fill import fill, find_missing
from pipeline.repair.frozen import find_frozen
from pipeline.repair.jumps import find_jumps, joined
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.shaking import find_noise
from pipeline.repair.swapped import find_broken_bones, find_swapped, swap_back
from pipeline.repair.unsteadiness import Seen, find_spikes

MOST_LOOKS = 4
"""How often small spikes are sought: a larger one hides what is beside it."""

BESIDE = 3
"""Frames between a stretch of one kind and one of another that touch each other, at most."""


def detect(clip: HumanClip, settings: DetectionSettings) -> tuple[HumanClip, Findings]:
    """The clip with exchanged sides put right, and everything else that is wrong with it."""
    findings = Findings(frame_count=clip.frame_count)
    findings.add(find_missing(clip, settings))
    seen = _bridged(clip, findings)
    swapped = find_swapped(seen.pos_w, clip.fps)
    if swapped:
        findings.add(swapped)
        pos_w, quat_w = swap_back(clip, swapped)
        clip = dataclasses.replace(clip, body_pos_w=pos_w, body_quat_w=quat_w)
        seen = _bridged(clip, findings)
    frozen, shaking = _frozen_and_shaking(clip, seen, findings, settings)
    if frozen or shaking:
        findings.add(frozen + shaking)
        seen = _bridged(clip, findings)
    broken = _new(find_broken_bones(seen.pos_w, findings.lost, settings), findings)
    if broken:
        findings.add(broken)
        seen = _bridged(clip, findings)
    jumps = joined(find_jumps(seen, findings.lost, clip.fps, settings), findings.defects)
    findings.add(jumps)
    for _ in range(MOST_LOOKS):
        seen = _bridged(clip, findings) if jumps else seen
        jumps = find_spikes(seen, findings.lost | findings.beside_cuts, clip.fps, settings)
        if not jumps:
            break
        findings.add(jumps)
    return clip, findings


def _frozen_and_shaking(
    clip: HumanClip, seen: Seen, findings: Findings, settings: DetectionSettings
) -> tuple[list[Defect], list[Defect]]:
    """What stands still, and what shakes although that is bridged.

    A joint that keeps a pose until it shakes, or from then on, did not jump out of it: that says nothing of the pose.
    """
    frozen = _new(find_frozen(seen, findings.lost, clip.fps, settings), findings)
    if frozen:
        seen = _bridged(clip, findings.with_more(frozen))
    shaking = _new(find_noise(seen, clip.fps, settings), findings)
    if not frozen or not shaking:
        return frozen, shaking
    kept = [one for one in frozen if not any(_touches(one, other) for other in shaking)]
    if len(kept) == len(frozen):
        return frozen, shaking
    seen = _bridged(clip, findings.with_more(kept))
    return kept, _new(find_noise(seen, clip.fps, settings), findings)


def _touches(one: Defect, shaking: Defect) -> bool:
    """Whether a joint jumps into its frozen stretch from shaking, or out of one that it did not jump into."""
    if one.code == "dropout":
        return abs(one.start - shaking.stop) <= BESIDE
    return one.code == "frozen_joint" and abs(one.stop - shaking.start) <= BESIDE


def _bridged(clip: HumanClip, findings: Findings) -> Seen:
    """The clip with its lost samples filled, however long the gaps: for looking at what is left."""
    pos_w, quat_w = fill(clip.body_pos_w, clip.body_quat_w, findings.lost_pos, findings.lost_rot, clip.fps)
    return Seen(pos_w=pos_w, quat_w=quat_w)


def _new(defects: list[Defect], findings: Findings) -> list[Defect]:
    """Defects with samples that were not lost already: a bridged gap at the clip's end is not frozen."""
    lost = findings.lost
    return [one for one in defects if not lost[one.start : one.stop][:, list(one.bodies)].all()]
