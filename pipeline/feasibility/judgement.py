"""Results of all criteria on one stretch, and the text in which they are stored with the answer.

    assessment of a stretch -> Judgement -> text (in the memo's answer) -> rows of the table of criteria

A criterion that does not apply to a stretch states why; it never counts as one that holds.
"""

import math
from collections.abc import Sequence

import msgspec

from pipeline.feasibility.assess import Assessment
from pipeline.feasibility.criterion import Result, Skipped, codes

NUMBER = "judgements"
"""Name that the text has among the numbers of a clip that was judged, until the table is made of it."""

DIGITS = 6
"""Significant digits of what is stored."""


class Found(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
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


class Judgement(msgspec.Struct, frozen=True, kw_only=True):
    """All criteria on a stretch of a clip."""

    start_s: float
    stop_s: float
    """Where the stretch is in the clip [s]."""
    found: dict[str, Found]
    """Code of each registered criterion -> its result."""
    piece: str = ""
    """Name of the clip that was made of it; empty where none was."""


def judge(assessment: Assessment, beside: Sequence[Result], start: int) -> Judgement:
    """The judgement on an assessed stretch.

    Args:
        beside: results on the clip that need no motion: likeness, length
        start: the stretch's first frame in the clip
    """
    results = {each.code: each for each in (*assessment.verdicts, *assessment.skipped, *beside)}
    found = {code: _found(results[code]) for code in codes() if code in results}
    clip = assessment.motion.clip
    start_s, stop_s = start / clip.fps, (start + clip.frame_count) / clip.fps
    return Judgement(start_s=start_s, stop_s=stop_s, found=found)


def to_text(judgements: Sequence[Judgement]) -> str:
    """JSON: a row a stretch, of it a row a criterion, of which what is left at its default is left out."""
    return _ENCODER.encode(judgements).decode()


def from_text(text: str) -> tuple[Judgement, ...]:
    """The judgements that `to_text` was called on, to `DIGITS` digits."""
    return _DECODER.decode(text)


_ENCODER = msgspec.json.Encoder()
_DECODER = msgspec.json.Decoder(tuple[Judgement, ...])


def _found(result: Result) -> Found:
    if isinstance(result, Skipped) or result.not_applicable:
        return Found(not_applicable=result.not_applicable)
    return Found(
        value=_rounded(result.value),
        limit=_rounded(result.limit),
        lower=result.lower,
        unit=result.unit,
        broken="" if result.holds else result.text,
    )


def _rounded(value: float) -> float | None:
    return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
