"""The part of `data/feasibility.yaml` that weights and coverage follow: how clips share the weight of command cells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pipeline.feasibility.units import MetresPerSecondCubed, Plain, Radians, Seconds
from pipeline.files.ranges import POSITIVE, SHARE, Range, check
from pipeline.files.sourced import Unit


@dataclass(frozen=True, kw_only=True)
class BalanceSettings:
    """How feasible clips share the weight."""

    cell_power: Plain
    """0: every second weighs the same; 1: every cell weighs the same."""
    max_ratio: Annotated[float, Unit("of the mean second")]
    """Largest weight of a second over the mean weight of a second."""
    same_gait: Radians
    """Motions whose gait signatures differ by less than this [rad, root mean square] share a part of a cell."""
    smooth_jerk: MetresPerSecondCubed
    """Mean jerk [m/s^3] at which a clip's weight is halved."""
    missing_seconds: Seconds
    """A cell with less than this [s] is missing."""

    def __post_init__(self) -> None:
        check(
            self,
            cell_power=SHARE,
            max_ratio=Range(1.0),
            same_gait=Range(0.0, 1.0),
            smooth_jerk=POSITIVE,
            missing_seconds=POSITIVE,
        )
