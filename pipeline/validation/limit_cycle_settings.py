"""Settings of `data/limit_cycles.yaml`: the compared walks. The thresholds are in `robots/<robot>/validation.yaml`."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.files.ranges import NOT_NEGATIVE, POSITIVE, check, increasing

LEG_JOINTS = ("left_hip", "left_knee", "right_hip", "right_knee")


@dataclass(frozen=True, kw_only=True)
class LimitCycleSettings:
    """The whole file."""

    speeds_m_s: tuple[float, ...]
    """Forward commands at which engines are compared."""
    seconds: float
    """Length of a walk in simulation [s]."""
    settled_s: float
    """Start of a walk that is excluded: standing, acceleration, settling [s]."""
    timestep_s: float
    friction: float
    command_tolerance: float
    """Largest deviation of a log's command on any axis [m/s, rad/s]."""
    joints: dict[str, str]
    """Name of `LEG_JOINTS` -> the robot's joint."""

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
