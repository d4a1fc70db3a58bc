"""Is a reference at fault that the tracker does not follow, or the tracker? Its neighbours decide.

The neighbours of a reference are the other references of its skill that show a motion as it was retargeted, originals
and mirror images. Variants (time scales, perturbations) are nobody's neighbours: the verdict on a reference does not
depend on which variants are asked for, and further ones that failures on hardware ask for change no earlier verdict.
"""

import dataclasses
from collections import Counter
from collections.abc import Mapping
from typing import Any

from pipeline.batch import Entry, Judged, Manifest, changed
from pipeline.tracking.process import AS_RETARGETED, NOT_TRACKED

FOLLOWED_SHARE = 0.8
"""A reference is at fault where the tracker follows at least this share of its neighbours to the end."""

AT_FAULT = "at_fault"
"""Number of a rejected reference."""


def compared_with_neighbours(rollouts: Manifest, references: Manifest) -> Manifest:
    """The rollouts without those of references at fault.

    A reference whose nominal rollout fails is rejected where the tracker follows its neighbours; otherwise the tracker
    may be too weak for the skill, and the stretches that it did follow are kept. The reason `not_tracked` states which.

    Args:
        rollouts: manifest of `pipeline.tracking.process`
        references: what was tracked, with `skill` and `variant`
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
        # it failed itself, so it is not among the followed
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
