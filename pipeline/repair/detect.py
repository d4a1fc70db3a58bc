"""All detectors in order, each on a clip in which what was found before is bridged."""

from __future__ import annotations

import dataclasses

from pipeline.clips.human_clip import HumanClip
from pipeline.repair.bones import find_broken_bones
from pipeline.repair.defect import Defect, Findings
from pipeline.repair.fill import fill
from pipeline.repair.frozen import find_frozen
from pipeline.repair.jumps import find_jumps, joined
from pipeline.repair.missing import find_missing
from pipeline.repair.roughness import find_noise, find_spikes
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.swapped import find_swapped, swap_back
from pipeline.repair.unsteadiness import Seen

MOST_LOOKS = 4
"""How often small spikes are sought: a larger one hides what is beside it."""


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
    frozen = _new(find_frozen(seen, clip.fps, settings), findings)
    if frozen:
        findings.add(frozen)
        seen = _bridged(clip, findings)
    shaking = _new(find_noise(seen, clip.fps, settings), findings)
    if shaking:
        findings.add(shaking)
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


def _bridged(clip: HumanClip, findings: Findings) -> Seen:
    """The clip with its lost samples filled, however long the gaps: for looking at what is left."""
    pos_w, quat_w = fill(clip.body_pos_w, clip.body_quat_w, findings.lost_pos, findings.lost_rot, clip.fps)
    return Seen(pos_w=pos_w, quat_w=quat_w)


def _new(defects: list[Defect], findings: Findings) -> list[Defect]:
    """Defects with samples that were not lost already: a bridged gap at the clip's end is not frozen."""
    lost = findings.lost
    return [one for one in defects if not lost[one.start : one.stop][:, list(one.bodies)].all()]
