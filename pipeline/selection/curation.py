"""Settings of data/curation.yaml: segmentation into windows, and the selection among them."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.clips.skill import LABELS
from pipeline.files.ranges import (
    NOT_NEGATIVE,
    POSITIVE,
    SHARE,
    Keys,
    OneOf,
    Pattern,
    Range,
    check,
)
from pipeline.selection.decisions import Decision
from pipeline.selection.skills import SkillBounds

EXPERT_MOTIONS = ("rollouts", "references", "both")


@dataclass(frozen=True, kw_only=True)
class WindowSettings:
    """Segmentation of a clip into windows."""

    velocity_s: float
    """Width of the moving mean on the root's velocity [s]."""
    facing_s: float
    """Width of the moving mean on the facing [s]."""
    label_hz: float
    """Rate at which frames are labelled, so that a clip's own rate does not matter [Hz]."""
    shortest_s: float
    """Shortest window of a skill [s]."""
    shortest_transition_s: float
    """Shortest transition [s]; shorter ones are merged into neighbouring windows."""
    bridge_s: float
    """Gaps of the recording up to this long are interpolated for the labels, longer ones are transitions [s]."""
    transition_cost: float
    """Cost of a transition frame [m/s]: the mean distance from a skill's region up to which frames belong to it."""
    cut_price: float
    """Price of one more cut [m]: distance from a region times the time that it lasts."""
    bounds: SkillBounds
    """The regions of the skills."""

    def __post_init__(self) -> None:
        check(
            self,
            velocity_s=Range(0.01, 5.0),
            facing_s=Range(0.01, 5.0),
            label_hz=Range(5.0, 1000.0),
            shortest_s=Range(0.0, 60.0, open_low=True),
            shortest_transition_s=Range(0.0, 60.0, open_low=True),
            bridge_s=Range(0.0, 5.0),
            transition_cost=POSITIVE,
            cut_price=NOT_NEGATIVE,
        )


@dataclass(frozen=True, kw_only=True)
class Curation:
    """Selection of windows for the database."""

    skills: tuple[str, ...]
    """Skills to select, of the ten and `transition`."""
    most_seconds: dict[str, float]
    """Skill -> most seconds selected; no limit for other skills."""
    shortest_s: float
    """Shortest window that is selected [s]."""
    least_recorded_share: float
    """Least share of recorded frames in a window; with fewer its label is a guess."""
    licences: tuple[str, ...]
    """Patterns (`*`, `?`, case does not matter) of licences that may be used."""
    excluded_clips: tuple[str, ...]
    """Patterns of names of clips or windows that are left out."""
    excluded_notes: tuple[str, ...]
    """Codes of notes (catalogue, readers) that exclude a file."""
    expert_motions: str
    """What the expert database is made of: `rollouts`, `references` or `both`."""
    windows: WindowSettings
    """Segmentation of a clip into windows."""
    decisions: tuple[Decision, ...] = ()
    """A person's decisions on single clips, the latest of a clip last."""

    def __post_init__(self) -> None:
        check(
            self,
            expert_motions=OneOf(EXPERT_MOTIONS),
            skills=OneOf(LABELS),
            most_seconds=Keys(keys=OneOf(LABELS), values=NOT_NEGATIVE),
            shortest_s=NOT_NEGATIVE,
            least_recorded_share=SHARE,
            licences=Pattern(),
            excluded_clips=Pattern(),
            excluded_notes=Pattern(),
        )
