"""Settings of `data/limit_cycles.yaml`: the compared walks. The thresholds are in `robots/<robot>/validation.yaml`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pipeline.files.ranges import NOT_NEGATIVE, POSITIVE, check, increasing

LEG_JOINTS = ("left_hip", "left_knee", "right_hip", "right_knee")


@dataclass(frozen=True, kw_only=True)
class LimitCycleSettings:
    """The whole file."""

    speeds_m_s: Annotated[tuple[float, ...], POSITIVE]
    """Forward commands at which engines are compared."""
    seconds: Annotated[float, POSITIVE]
    """Length of a walk in simulation [s]."""
    settled_s: Annotated[float, NOT_NEGATIVE]
    """Start of a walk that is excluded: standing, acceleration, settling [s]."""
    timestep_s: Annotated[float, POSITIVE]
    friction: Annotated[float, POSITIVE]
    command_tolerance: Annotated[float, POSITIVE]
    """Largest deviation of a log's command on any axis [m/s, rad/s]."""
    joints: dict[str, str]
    """Name of `LEG_JOINTS` -> the robot's joint."""

    def __post_init__(self) -> None:
        check(increasing(self, "settled_s", "seconds"), _missing(self.joints))


def _missing(joints: dict[str, str]) -> list[tuple[str, str]]:
    return [(f"joints.{name}", "is missing") for name in LEG_JOINTS if name not in joints]
