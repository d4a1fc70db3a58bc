"""A person's decisions on clips: part of data/curation.yaml, written by `booster-lab curate` or by hand.

An excluded recording or window is left out by KP1, an excluded variant or rollout by KP5. An accepted clip is one that
a person reviewed: accepting replaces an exclusion, but lets nothing in that a criterion rejects.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pipeline.batch import Manifest
from pipeline.clips.outcome import Reason
from pipeline.files.ranges import Allowed, OneOf

ACCEPT, EXCLUDE = "accept", "exclude"
MOST_LETTERS = 500
"""Of a name or a reason."""


@dataclass(frozen=True)
class Line(Allowed):
    """One line of text that is not empty."""

    def problem(self, value: Any) -> str | None:
        text = str(value)
        if not text.strip() or len(text) > MOST_LETTERS or not text.isprintable():
            return f"is {text[:40]!r}, allowed is one line of 1 to {MOST_LETTERS} letters"
        return None


@dataclass(frozen=True, kw_only=True)
class Decision:
    """A person's decision on one clip."""

    clip: Annotated[str, Line()]
    """Exact name of a recording, window, variant or rollout."""
    verdict: Annotated[str, OneOf((ACCEPT, EXCLUDE))]
    """`accept` or `exclude`."""
    by: Annotated[str, Line()]
    """Name of the person."""
    why: Annotated[str, Line()]
    """Reason, one sentence."""
    day: Annotated[str, Line()]
    """When it was made, as `2026-11-26`."""

    def text(self) -> str:
        """The decision as a sentence."""
        return f"{'excluded' if self.verdict == EXCLUDE else 'accepted'} by {self.by} on {self.day}: {self.why}"


def exclusions(decisions: Iterable[Decision]) -> dict[str, Decision]:
    """Name of each excluded clip -> the decision."""
    return {each.clip: each for each in decisions if each.verdict == EXCLUDE}


def without_excluded(manifest: Manifest, decisions: Sequence[Decision]) -> Manifest:
    """The manifest without the clips that a person excluded, under their own name or that of the clip they came from.

    Each of them keeps the decision as the reason of its rejection.
    """
    excluded = exclusions(decisions)
    input_of = {piece: row.clip for row in manifest.judged for piece in row.pieces}
    dropped: dict[str, dict[str, Any]] = {}
    for entry in manifest.entries:
        decision = excluded.get(entry.clip) or excluded.get(input_of.get(entry.clip, ""))
        if decision is not None:
            dropped[entry.clip] = reason_of(entry.clip, decision)
    return manifest.without(dropped) if dropped else manifest


def reason_of(clip: str, decision: Decision) -> dict[str, Any]:
    """The decision as the reason of a rejection."""
    return Reason(code="excluded_by_person", text=f"{clip}: {decision.text()}", effect="rejected").to_dict()
