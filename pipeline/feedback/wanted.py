"""Approved changes of what is selected and augmented, put over the settings of these stages."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from pipeline.augment import AugmentSettings
from pipeline.feedback.change import Change
from pipeline.selection.curation import Curation


def wanted_seconds(curation: Curation, changes: Sequence[Change]) -> Curation:
    """The curation with more seconds of some skills. A skill without a bound has no more to give."""
    factors: dict[str, float] = {}
    for change in changes:  # of several robots; the windows are all robots'
        factors[change.what] = max(factors.get(change.what, 1.0), change.value)
    most = {skill: seconds * factors.get(skill, 1.0) for skill, seconds in curation.most_seconds.items()}
    return dataclasses.replace(curation, most_seconds=most)


def further_speeds(changes: Sequence[Change], settings: AugmentSettings) -> dict[str, AugmentSettings]:
    """Skill -> settings that make its further playing speeds alone, beside those that all clips get."""
    found = {}
    for change in changes:
        scales = tuple(round(1.0 + sign * change.value, 6) for sign in (-1.0, 1.0))
        new = tuple(scale for scale in scales if scale not in settings.time_scales)
        if new and change.what not in settings.unscaled_skills:
            found[change.what] = dataclasses.replace(settings, time_scales=new)
    return found
