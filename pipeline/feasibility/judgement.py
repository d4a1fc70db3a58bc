"""Results of all criteria on one stretch, and their JSON form in the stored result of a clip.

    assessment of a stretch -> Judgement -> text (in the memo's answer) -> rows of the table of criteria

A criterion that does not apply to a stretch states why; it does not count as passed.
"""

import math
from collections.abc import Sequence

import msgspec

from pipeline.feasibility.assess import Assessment
from pipeline.feasibility.criterion import Result, Skipped, codes

NUMBER = "judgements"
"""Key of the text among the numbers of an evaluated clip, until the table is made from it."""

DIGITS = 6
"""Significant digits of stored numbers."""


class Found(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Result of one criterion on one stretch."""

    value: float | None = None
    """Measured value; None if the criterion does not apply or the value is not finite."""
    limit: float | None = None
    lower: bool = False
    """Whether the limit is a lower bound."""
    unit: str = ""
    broken: str = ""
    """Sentence on the violation; empty if the criterion passes."""
    not_applicable: str = ""
    """Why the criterion does not apply; empty if it does."""


class Judgement(msgspec.Struct, frozen=True, kw_only=True):
    """Results of all criteria on a stretch of a clip."""

    start_s: float
    stop_s: float
    """End of the stretch in the clip [s]."""
    found: dict[str, Found]
    """Code of each registered criterion -> its result."""
    piece: str = ""
    """Name of the clip made from the stretch; empty if there is none."""


def judge(assessment: Assessment, beside: Sequence[Result], start: int) -> Judgement:
    """The results on an assessed stretch.

    Args:
        assessment: verdicts on the stretch's motion
        beside: results that need no motion: likeness, length
        start: the stretch's first frame in the clip
    """
    results = {each.code: each for each in (*assessment.verdicts, *assessment.skipped, *beside)}
    found = {code: _found(results[code]) for code in codes() if code in results}
    clip = assessment.motion.clip
    start_s, stop_s = start / clip.fps, (start + clip.frame_count) / clip.fps
    return Judgement(start_s=start_s, stop_s=stop_s, found=found)


def to_text(judgements: Sequence[Judgement]) -> str:
    """JSON: a list of stretches, each with a result per criterion; default values are left out."""
    return _ENCODER.encode(judgements).decode()


def from_text(text: str) -> tuple[Judgement, ...]:
    """Inverse of `to_text`, with numbers to `DIGITS` digits."""
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
