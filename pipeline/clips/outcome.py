"""The result of a stage for one clip: kept pieces, reasons and numbers. Labels of skills."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip

Clip = HumanClip | RobotClip
Number = float | int | str | bool | None
"""A number or word that a stage reports of a clip: JSON's flat types."""
Numbers = Mapping[str, Number]


@dataclass(frozen=True, kw_only=True)
class Reason:
    """One finding and its effect."""

    code: str
    """Short name for counting: `teleport`, `joint_limit`, `excluded_by_person`."""
    text: str
    """A message with location, value and limit."""
    effect: str
    """`rejected` (the clip or stretch is not kept), `repaired` (changed and kept) or `noted`."""
    start_s: float | None = None
    """Where it starts in the clip [s]; None for the whole clip."""
    stop_s: float | None = None
    value: float | None = None
    """The measured value."""
    limit: float | None = None
    """The limit that it was compared with."""
    unit: str = ""

    @classmethod
    def of_frames(
        cls, code: str, text: str, effect: str, frames: tuple[int, int], fps: float, **numbers: Any
    ) -> "Reason":
        """A fact about frames [first, last) of a clip at `fps` [Hz]; `numbers`: value, limit and unit."""
        first, last = frames
        return cls(code=code, text=text, effect=effect, start_s=first / fps, stop_s=last / fps, **numbers)

    def to_dict(self) -> dict:
        return {key: value for key, value in vars(self).items() if value is not None and value != ""}


@dataclass(frozen=True, kw_only=True)
class Piece:
    """One clip that is passed to the next stage, with its numbers (flat, JSON types)."""

    clip: Clip
    numbers: Numbers = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Result of a stage on one clip: none, one or several pieces, and numbers of the input even where none is kept."""

    pieces: tuple[Piece, ...] = ()
    reasons: tuple[Reason, ...] = ()
    numbers: Numbers = field(default_factory=dict)


SKILLS: tuple[str, ...] = (
    "stand",
    "turn_left",
    "turn_right",
    "side_left",
    "side_right",
    "back",
    "walk_slow",
    "walk",
    "walk_fast_jog",
    "run",
)
"""Labels of windows."""

TRANSITION = "transition"
"""Label of frames between two skills that are neither."""

LABELS: tuple[str, ...] = (*SKILLS, TRANSITION)
