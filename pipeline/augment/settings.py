"""What KP4 makes of each clip."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.errors import PipelineError


class TimeScaleError(PipelineError):
    """A time scale that no variant can be made with."""

    def __init__(self, scale: float):
        super().__init__(f"time scale {scale:g} is not allowed; it must lie in 0.5 to 2 and not be 1")


@dataclass(frozen=True, kw_only=True)
class AugmentSettings:
    """`data/augment.yaml`."""

    mirror: bool
    """Add each clip reflected in the robot's left-right plane."""
    time_scales: tuple[float, ...]
    """Playing speeds to add beside the original: at 1.1 every speed is 1.1 times as high."""
    unscaled_skills: tuple[str, ...]
    """Skills that are only mirrored: their speed is what makes them."""

    def __post_init__(self) -> None:
        for scale in self.time_scales:
            if not 0.5 <= scale <= 2.0 or scale == 1.0:
                raise TimeScaleError(scale)
