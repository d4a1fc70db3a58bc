"""Decide whether a tracking failure is due to the reference or to the tracker, from the reference's neighbours.

The neighbours of a reference are the other unmodified references (originals and mirror images) of its skill. Variants
(time scales, perturbations) are not neighbours, so that the verdict on a reference does not depend on the requested
variants, and variants added because of failures on hardware change no earlier verdict.
"""

import dataclasses
from collections import Counter
from collections.abc import Mapping
from typing import Any

from pipeline.batch import Entry, Judged, Manifest, changed
from pipeline.tracking.process import AS_RETARGETED, NOT_TRACKED

FOLLOWED_SHARE = 0.8
"""Share of neighbours followed to the end from which a failure is attributed to the reference."""

AT_FAULT = "at_fault"
"""Key of the number that marks a rejected reference."""


def compared_with_neighbours(rollouts: Manifest, references: Manifest) -> Manifest:
    """Remove the rollouts of references that are at fault.

    A reference whose nominal rollout fails is rejected if the tracker follows its neighbours; otherwise the tracker may
    be too weak for the skill, and the stretches that it followed are kept. The reason `not_tracked` states which.

    Args:
        rollouts: manifest of `pipeline.tracking.process`
        references: manifest of the tracked motions, with `skill` and `variant`
    """
    facts = {entry.clip: entry.numbers for entry in references.entries}
    seen, followed = Counter[str](), Counter[str]()
    for row in rollouts.judged:
        if _as_retargeted(facts[row.clip]) and "survived" in row.numbers:
            skill = str(facts[row.clip].get("skill", ""))
            seen[skill] += 1
            followed[skill] += bool(row.numbers["survived"])
    at_fault: set[str] = set()

    def compared(row: Judged) -> Judged:
        if not any(reason["code"] == NOT_TRACKED for reason in row.reasons):
            return row
        skill = str(facts[row.clip].get("skill", ""))
        # the reference itself failed, so it is not among the followed
        others = seen[skill] - _as_retargeted(facts[row.clip])
        fault = others > 0 and followed[skill] >= FOLLOWED_SHARE * others
        row = _with_reason(row, _why(skill, followed[skill], others, fault))
        if fault:
            at_fault.add(row.clip)
            row = dataclasses.replace(row, pieces=(), numbers={**row.numbers, "seconds_out": 0.0, AT_FAULT: True})
        return row

    judged = changed(Judged, rollouts.judged, compared)
    entries = changed(Entry, rollouts.entries, lambda each: None if each.numbers["reference"] in at_fault else each)
    return dataclasses.replace(rollouts, entries=entries, judged=judged)


def _as_retargeted(numbers: Mapping[str, Any]) -> bool:
    return numbers.get("variant") in AS_RETARGETED


def _why(skill: str, followed: int, others: int, fault: bool) -> str:
    if not others:
        return f"No other motion of the skill '{skill}' was tracked, so it is open whether the reference is at fault"
    end = "so the reference is at fault" if fault else "so the tracker may be too weak for this skill"
    return f"It follows {followed} of {others} other motions of the skill '{skill}' and their mirror images, {end}"


def _with_reason(row: Judged, why: str) -> Judged:
    reasons = tuple(
        {**reason, "text": f"{reason['text']}. {why}"} if reason["code"] == NOT_TRACKED else reason
        for reason in row.reasons
    )
    return dataclasses.replace(row, reasons=reasons)
