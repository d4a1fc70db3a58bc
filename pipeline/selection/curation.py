"""Settings of data/curation.yaml: segmentation into windows, the selection among them, and a person's decisions.

Decisions are written by `booster-lab curate` or by hand. An excluded recording or window is left out by KP1, an
excluded variant or rollout by KP5. An accepted clip is one that a person reviewed: accepting replaces an exclusion, but
lets nothing in that a criterion rejects.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pipeline.batch import Manifest
from pipeline.clips.outcome import LABELS, Reason
from pipeline.files.ranges import (
    NOT_NEGATIVE,
    POSITIVE,
    SHARE,
    Allowed,
    Keys,
    OneOf,
    Pattern,
    Range,
)
from pipeline.selection.skills import SkillBounds

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


EXPERT_MOTIONS = ("rollouts", "references", "both")


@dataclass(frozen=True, kw_only=True)
class WindowSettings:
    """Segmentation of a clip into windows."""

    velocity_s: Annotated[float, Range(0.01, 5.0)]
    """Width of the moving mean on the root's velocity [s]."""
    facing_s: Annotated[float, Range(0.01, 5.0)]
    """Width of the moving mean on the facing [s]."""
    label_hz: Annotated[float, Range(5.0, 1000.0)]
    """Rate at which frames are labelled, so that a clip's own rate does not matter [Hz]."""
    shortest_s: Annotated[float, Range(0.0, 60.0, open_low=True)]
    """Shortest window of a skill [s]."""
    shortest_transition_s: Annotated[float, Range(0.0, 60.0, open_low=True)]
    """Shortest transition [s]; shorter ones are merged into neighbouring windows."""
    bridge_s: Annotated[float, Range(0.0, 5.0)]
    """Gaps of the recording up to this long are interpolated for the labels, longer ones are transitions [s]."""
    transition_cost: Annotated[float, POSITIVE]
    """Cost of a transition frame [m/s]: the mean distance from a skill's region up to which frames belong to it."""
    cut_price: Annotated[float, NOT_NEGATIVE]
    """Price of one more cut [m]: distance from a region times the time that it lasts."""
    bounds: SkillBounds
    """The regions of the skills."""


@dataclass(frozen=True, kw_only=True)
class Curation:
    """Selection of windows for the database."""

    skills: Annotated[tuple[str, ...], OneOf(LABELS)]
    """Skills to select, of the ten and `transition`."""
    most_seconds: Annotated[dict[str, float], Keys(keys=OneOf(LABELS), values=NOT_NEGATIVE)]
    """Skill -> most seconds selected; no limit for other skills."""
    shortest_s: Annotated[float, NOT_NEGATIVE]
    """Shortest window that is selected [s]."""
    least_recorded_share: Annotated[float, SHARE]
    """Least share of recorded frames in a window; with fewer its label is a guess."""
    licences: Annotated[tuple[str, ...], Pattern()]
    """Patterns (`*`, `?`, case does not matter) of licences that may be used."""
    excluded_clips: Annotated[tuple[str, ...], Pattern()]
    """Patterns of names of clips or windows that are left out."""
    excluded_notes: Annotated[tuple[str, ...], Pattern()]
    """Codes of notes (catalogue, readers) that exclude a file."""
    expert_motions: Annotated[str, OneOf(EXPERT_MOTIONS)]
    """What the expert database is made of: `rollouts`, `references` or `both`."""
    windows: WindowSettings
    """Segmentation of a clip into windows."""
    decisions: tuple[Decision, ...] = ()
    """A person's decisions on single clips, the latest of a clip last."""
