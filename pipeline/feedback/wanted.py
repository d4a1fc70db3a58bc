"""Approved changes of what is selected and augmented, put over the settings of these stages."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from pipeline.augment import AugmentSettings, Strengths
from pipeline.feedback.change import Change, neutral, perturbation_of
from pipeline.feedback.rules import TIME_SCALE
from pipeline.selection.curation import Curation


def wanted_seconds(curation: Curation, changes: Sequence[Change]) -> Curation:
    """The curation with more seconds of some skills. A skill without a bound has no more to give."""
    factors: dict[str, float] = {}
    for change in changes:  # of several robots; the windows are all robots'
        factors[change.what] = max(factors.get(change.what, 1.0), change.value)
    most = {skill: seconds * factors.get(skill, 1.0) for skill, seconds in curation.most_seconds.items()}
    return dataclasses.replace(curation, most_seconds=most)


def further_variants(changes: Sequence[Change], settings: AugmentSettings) -> dict[str, AugmentSettings]:
    """Skill -> settings that make its further variants alone, beside those that all clips get."""
    found: dict[str, AugmentSettings] = {}
    none = dataclasses.replace(settings, time_scales=(), perturbations=Strengths())
    for change in changes:
        kind, skill = perturbation_of(change.what)
        own = found.get(skill, none)
        more = _with_speeds(own, change.value, settings) if kind == TIME_SCALE else _with(own, kind, change, settings)
        if more != own:
            found[skill] = more
    return found


def _with_speeds(own: AugmentSettings, width: float, settings: AugmentSettings) -> AugmentSettings:
    scales = tuple(round(1.0 + sign * width, 6) for sign in (-1.0, 1.0))
    new = tuple(scale for scale in scales if scale != 1.0 and scale not in settings.time_scales)
    return dataclasses.replace(own, time_scales=(*own.time_scales, *new))


def _with(own: AugmentSettings, kind: str, change: Change, settings: AugmentSettings) -> AugmentSettings:
    if change.value == neutral(kind) or change.value in getattr(settings.perturbations, kind):
        return own
    strengths = {kind: (*getattr(own.perturbations, kind), change.value)}
    return dataclasses.replace(own, perturbations=dataclasses.replace(own.perturbations, **strengths))
