"""Settings of data/curation.yaml: segmentation into windows, and the selection among them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pipeline.clips.skill import LABELS
from pipeline.files.ranges import (
    NOT_NEGATIVE,
    POSITIVE,
    SHARE,
    Keys,
    OneOf,
    Pattern,
    Range,
)
from pipeline.selection.decisions import Decision
from pipeline.selection.skills import SkillBounds

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
