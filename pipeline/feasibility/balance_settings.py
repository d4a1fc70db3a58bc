"""The part of `data/feasibility.yaml` that weights and coverage follow: command cells and how they are balanced."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pipeline.files.ranges import NOT_NEGATIVE, POSITIVE, SHARE, Range, check


@dataclass(frozen=True, kw_only=True)
class CommandSettings:
    """The cells of the command space that clips are balanced over."""

    forward: tuple[float, float, float]
    """Lowest, highest and width of cells [m/s]."""
    lateral: tuple[float, float, float]
    """[m/s]"""
    yaw_rate: tuple[float, float, float]
    """[rad/s]"""
    standing_m_s: float
    """Slower than this over ground [m/s] ..."""
    standing_rad_s: float
    """... and turning slower than this [rad/s] is standing."""

    def __post_init__(self) -> None:
        check(
            self, _axes(self, "forward", "lateral", "yaw_rate"), standing_m_s=NOT_NEGATIVE, standing_rad_s=NOT_NEGATIVE
        )


@dataclass(frozen=True, kw_only=True)
class BalanceSettings:
    """How feasible clips share the weight."""

    commands: CommandSettings
    cell_power: float
    """0: every second weighs the same; 1: every cell weighs the same."""
    max_ratio: float
    """Largest weight of a second over the mean weight of a second."""
    same_gait: float
    """Motions whose gait signatures differ by less than this [rad, root mean square] share a part of a cell."""
    smooth_jerk: float
    """Mean jerk [m/s^3] at which a clip's weight is halved."""
    missing_seconds: float
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


def _axes(settings: Any, *names: str) -> list[tuple[str, str]]:
    """Faults of axes (lowest, highest, width of a cell) that are not made of one or more whole cells."""
    faults = []
    for name in names:
        axis = getattr(settings, name, None)
        if not axis or len(axis) != 3 or None in axis:
            continue
        low, high, width = axis
        cells = (high - low) / width if width > 0.0 else 0.0
        if not 0.5 < cells < 1_000.5 or abs(cells - round(cells)) > 1e-6:
            faults.append((name, f"is {low:g} to {high:g} in cells of {width:g}, allowed are 1 to 1000 whole cells"))
    return faults
