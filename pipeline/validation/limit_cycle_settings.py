"""What `data/limit_cycles.yaml` states: which walks are compared, and how far engines may differ."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.files.ranges import NOT_NEGATIVE, POSITIVE, check


@dataclass(frozen=True, kw_only=True)
class LimitCycleSettings:
    """What `data/limit_cycles.yaml` states."""

    required_m_s: tuple[float, ...]
    """Forward commands at which engines must agree."""
    shown_m_s: tuple[float, ...]
    """Those at which their difference is shown and not required."""
    seconds: float
    """Of a walk in simulation."""
    settled_s: float
    """Start of a walk that is left out: standing, speeding up, settling."""
    timestep_s: float
    friction: float
    command_tolerance: float
    """How far the command of a log may be from the wanted one on any axis [m/s, rad/s]."""
    joints: dict[str, str]
    """`left_hip`, `left_knee`, `right_hip`, `right_knee` -> the robot's joint."""
    max_shape_distance: float
    """Between engines, in each plane."""
    max_period_difference: float
    """Between engines, as a share of the period."""
    max_amplitude_difference: float
    """Between engines, as a share of the amplitude."""

    def __post_init__(self) -> None:
        positive = (
            "required_m_s",
            "shown_m_s",
            "seconds",
            "timestep_s",
            "friction",
            "command_tolerance",
            "max_shape_distance",
        )
        more = ("max_period_difference", "max_amplitude_difference")
        check(self, settled_s=NOT_NEGATIVE, **dict.fromkeys((*positive, *more), POSITIVE))
