"""The sections `torque` of `data/feasibility.yaml`: limits on the forces that a simulation recorded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pipeline.feasibility.units import OfFrames, OfWeight, Seconds
from pipeline.files.ranges import POSITIVE, SHARE, Range, check
from pipeline.files.sourced import Unit

RATIO = Range(0.5, 5.0)
"""Of a robot's limit."""
SECONDS = Range(0.0, 10.0)
CUTOFF_HZ = Range(1.0, 25.0)
"""Of low passes at the database's 50 Hz."""


@dataclass(frozen=True, kw_only=True)
class TorqueSettings:
    """Motor torques and contact forces of a rollout, as its simulation recorded them."""

    saturation: Annotated[float, Unit("of the torque limit")]
    """A motor is saturated where it gives more than this of its limit."""
    saturation_share: OfFrames
    """Largest share of a joint's frames in which its motor is saturated."""
    saturation_run_s: Seconds
    """Longest time that a motor may be saturated without a break [s]."""
    force_residual: OfWeight
    """Largest mean over a window of the force that contacts and pushes do not explain, over the weight."""
    residual_window_s: Seconds
    """Length of the window [s]."""

    def __post_init__(self) -> None:
        check(
            self,
            saturation=Range(0.5, 1.0),
            saturation_share=SHARE,
            saturation_run_s=SECONDS,
            force_residual=POSITIVE,
            residual_window_s=Range(0.02, 10.0),
        )
