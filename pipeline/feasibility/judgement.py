"""What all criteria said of one stretch, held or not, and as text to be stored with the answer.

    assessment of a stretch -> Judgement -> text (in the memo's answer) -> rows of the table of criteria

A criterion that can't be asked of a stretch says why; it never counts as one that holds.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pipeline.clips.outcome import Numbers
from pipeline.feasibility.assess import Assessment
from pipeline.feasibility.criteria import GROUP_OF, GROUPS, LENGTH
from pipeline.feasibility.foot_criteria import held_to_stand
from pipeline.feasibility.likeness_criteria import FIGURES
from pipeline.feasibility.reference import CONTENT
from pipeline.feasibility.settings import FootSettings
from pipeline.feasibility.verdict import Verdict

NUMBER = "judgements"
"""Name that the text has among the numbers of a clip that was judged, until the table is made of it."""

DIGITS = 6
"""Significant digits of what is stored."""

NO_ROLLOUT = "no tracked rollout"
PERTURBED = "a rollout that was changed on purpose"
NOT_CUT = "no rollout of KP4"
NO_FIGURES = "no figure of retargeting"
NO_LABELS = "no contact labels"
LABELLED = "contacts are labelled"
SIMULATED = "the contacts are the simulation's"
NO_STANCE = "no foot is in contact"
NO_FORCES = "no simulation recorded its forces"
NOT_ASKED = "not asked"

FOLLOWED = "tracking_followed"
"""The criterion of what KP4 cuts away where tracking fails."""
FORCES = (*GROUPS["torque"], *GROUPS["contact forces"])
"""Criteria of recorded forces."""
OF_LABELS = ("foot_slip_mean", "contact_disagreement")
"""Criteria of feet that are labelled as in contact ..."""
OF_STANCES = ("foot_slip_mean", "foot_slip_p95")
"""... of feet that are, by their labels or as the soles tell it ..."""
INFERRED = ("foot_told_slip_mean", "contact_disagreement", "foot_glide_s")
"""Criteria of contacts that are inferred from the soles."""
OF_SOLES = "foot_told_slip_mean"
"""... and of those that the soles tell, whatever is labelled."""


@dataclass(frozen=True, kw_only=True)
class Found:
    """One criterion on one stretch."""

    value: float | None = None
    """None where it was not asked, or is not finite."""
    limit: float | None = None
    lower: bool = False
    """The limit is the lowest value allowed."""
    unit: str = ""
    broken: str = ""
    """What is wrong, as a sentence; empty where nothing is."""
    not_applicable: str = ""
    """Why it was not asked."""


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """All criteria on a stretch of a clip."""

    start_s: float
    stop_s: float
    """Where the stretch lies in the clip [s]."""
    found: Mapping[str, Found]
    """Criterion -> what it said, for every one in `criteria.GROUP_OF`."""
    piece: str = ""
    """Name of the clip that went on from it; empty where none did."""


def judge(
    assessment: Assessment, beside: Sequence[Verdict], numbers: Numbers, start: int, feet: FootSettings
) -> Judgement:
    """The judgement on an assessed stretch.

    Args:
        beside: verdicts on the clip that need no motion: likeness, length
        numbers: what earlier stages said of the clip
        start: the stretch's first frame in it
        feet: what the stretch was assessed with, which says what feet are held to stand
    """
    verdicts = {verdict.code: verdict for verdict in (*assessment.verdicts, *beside)}
    nobody = _without_stance(assessment, feet)
    found = {}
    for code in GROUP_OF:
        why = _not_applicable(code, code in verdicts, assessment, numbers, nobody)
        found[code] = Found(not_applicable=why) if why else _found(verdicts[code])
    clip = assessment.motion.clip
    start_s, stop_s = start / clip.fps, (start + clip.frame_count) / clip.fps
    return Judgement(start_s=start_s, stop_s=stop_s, found=found)


def length(seconds: float, least_s: float) -> Verdict:
    """The verdict on a clip's length."""
    text = f"only {seconds:.2f} s long"
    return Verdict(code=LENGTH, value=seconds, limit=least_s, unit="s", text=text, lower=True)


def to_text(judgements: Sequence[Judgement]) -> str:
    """JSON: a row a stretch, of it a row a criterion; what is left at its default is left out."""
    return json.dumps([_plain(each) for each in judgements], separators=(",", ":"), allow_nan=False)


def from_text(text: str) -> tuple[Judgement, ...]:
    """The judgements that `to_text` was called on, to `DIGITS` digits."""
    judgements = []
    for row in json.loads(text):
        found = {code: Found(**values) for code, values in row.pop("found").items()}
        judgements.append(Judgement(**row, found=found))
    return tuple(judgements)


def _without_stance(assessment: Assessment, feet: FootSettings) -> frozenset[str]:
    """Criteria of slip that hold no foot of a stretch to stand."""
    standing, told = held_to_stand(assessment.motion, feet)
    return frozenset((*(() if standing.any() else OF_STANCES), *(() if told.any() else (OF_SOLES,))))


def _not_applicable(code: str, asked: bool, assessment: Assessment, numbers: Numbers, nobody: frozenset[str]) -> str:
    """Why a criterion says nothing of a stretch; empty where it does. Those of `nobody` found no foot to ask."""
    motion = assessment.motion
    if motion.simulated and code in INFERRED:
        return SIMULATED
    if code in OF_LABELS and not motion.labelled:
        return NO_LABELS
    if code in nobody:
        return NO_STANCE
    if asked:
        return ""
    if code in FORCES:
        return NO_FORCES
    if code == "foot_glide_s":
        return LABELLED
    if code in GROUPS["tracking stability"]:
        if not numbers.get(CONTENT):
            return NO_ROLLOUT
        return NOT_CUT if code == FOLLOWED else PERTURBED
    if code in FIGURES:
        return (
            f"{NO_FIGURES}: KP3 had no sample of it" if code in numbers else f"{NO_FIGURES}: the robot's own recording"
        )
    return NOT_ASKED


def _found(verdict: Verdict) -> Found:
    return Found(
        value=_rounded(verdict.value),
        limit=_rounded(verdict.limit),
        lower=verdict.lower,
        unit=verdict.unit,
        broken="" if verdict.holds else verdict.text,
    )


def _rounded(value: float) -> float | None:
    return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None


def _plain(judgement: Judgement) -> dict:
    default = vars(Found())
    found = {
        code: {name: value for name, value in vars(each).items() if value != default[name]}
        for code, each in judgement.found.items()
    }
    return {**vars(judgement), "found": found}
