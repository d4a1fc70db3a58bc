"""What `data/limit_cycles.yaml` states: which walks are compared. What must hold `data/validation.yaml` says."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.files.ranges import NOT_NEGATIVE, POSITIVE, check, increasing

LEG_JOINTS = ("left_hip", "left_knee", "right_hip", "right_knee")


@dataclass(frozen=True, kw_only=True)
class LimitCycleSettings:
    """What `data/limit_cycles.yaml` states."""

    speeds_m_s: tuple[float, ...]
    """Forward commands at which engines are compared."""
    seconds: float
    """Of a walk in simulation."""
    settled_s: float
    """Start of a walk that is left out: standing, speeding up, settling."""
    timestep_s: float
    friction: float
    command_tolerance: float
    """How far the command of a log may be from the wanted one on any axis [m/s, rad/s]."""
    joints: dict[str, str]
    """Of `LEG_JOINTS`, each -> the robot's joint."""

    def __post_init__(self) -> None:
        positive = ("speeds_m_s", "seconds", "timestep_s", "friction", "command_tolerance")
        check(
            self,
            increasing(self, "settled_s", "seconds"),
            _missing(getattr(self, "joints", None)),
            settled_s=NOT_NEGATIVE,
            **dict.fromkeys(positive, POSITIVE),
        )


def _missing(joints: dict[str, str] | None) -> list[tuple[str, str]]:
    return [(f"joints.{name}", "is missing") for name in LEG_JOINTS if joints is not None and name not in joints]
