"""The commands that motions are wanted for, as `data/commands.yaml` states them with their sources."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from pipeline.feasibility.units import MetresPerSecond, RadiansPerSecond
from pipeline.files.ranges import NOT_NEGATIVE, check
from pipeline.files.sourced import Unit


@dataclass(frozen=True, kw_only=True)
class CommandSettings:
    """`data/commands.yaml`: the cells of the command space, that weights are spread over and feedback is told in."""

    forward: Annotated[tuple[float, float, float], Unit("m/s")]
    """Lowest, highest and width of cells [m/s]."""
    lateral: Annotated[tuple[float, float, float], Unit("m/s")]
    """[m/s]"""
    yaw_rate: Annotated[tuple[float, float, float], Unit("rad/s")]
    """[rad/s]"""
    standing_m_s: MetresPerSecond
    """Slower than this over ground [m/s] ..."""
    standing_rad_s: RadiansPerSecond
    """... and turning slower than this [rad/s] is standing."""

    def __post_init__(self) -> None:
        check(
            self, _axes(self, "forward", "lateral", "yaw_rate"), standing_m_s=NOT_NEGATIVE, standing_rad_s=NOT_NEGATIVE
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
