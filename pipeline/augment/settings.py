"""What KP4 makes of each clip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pipeline.augment.strengths import Strengths
from pipeline.clips.skill import LABELS
from pipeline.files.ranges import OneOf, Range
from pipeline.quality.sole_contact import ContactSettings


@dataclass(frozen=True)
class _Scale(Range):
    """A time scale that changes something."""

    def problem(self, value: float) -> str | None:
        return "is 1, which is the original" if value == 1.0 else super().problem(value)


@dataclass(frozen=True, kw_only=True)
class AugmentSettings:
    """`data/augment.yaml`."""

    mirror: bool
    """Add each clip reflected in the robot's left-right plane."""
    time_scales: Annotated[tuple[float, ...], _Scale(0.5, 2.0)]
    """Playing speeds to add beside the original: at 1.1 every speed is 1.1 times as high."""
    unscaled_skills: Annotated[tuple[str, ...], OneOf(LABELS)]
    """Skills that are played at no other speed: standing is the same slower."""
    perturbations: Strengths
    """Variants with other steps or another posture."""
    contact: ContactSettings
    """What contact is in a recording that does not say it, where those are made."""
