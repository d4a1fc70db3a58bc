"""What `data/cross_engine.yaml` states: the grid, the bars of each cell, and how far engines may differ."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.files.ranges import COUNT, NOT_NEGATIVE, POSITIVE, Range, check


@dataclass(frozen=True, kw_only=True)
class SimulationSettings:
    """What all engines have in common."""

    timestep_s: float
    friction: float
    seeds: int
    """Starts of each cell; the first is the default pose exactly."""
    start_joint_pos: float
    """Half width of the other starts' joint positions about the default pose [rad]."""
    start_yaw: float
    """Half width of their heading [rad]."""

    def __post_init__(self) -> None:
        check(self, timestep_s=Range(0.0005, 0.02), friction=POSITIVE, seeds=COUNT, start_joint_pos=Range(0.0, 0.2))


@dataclass(frozen=True, kw_only=True)
class AgreementSettings:
    """Largest difference of a cell's figures between two engines."""

    velocity_m_s: float
    velocity_share: float
    """Of the speed in MuJoCo; the larger of both holds."""
    yaw_rate_rad_s: float
    height_m: float

    def __post_init__(self) -> None:
        names = ("velocity_m_s", "velocity_share", "yaw_rate_rad_s", "height_m")
        check(self, **dict.fromkeys(names, POSITIVE))


@dataclass(frozen=True, kw_only=True)
class Segment:
    """A stretch of one wanted velocity."""

    seconds: float
    command: tuple[float, float, float]
    """Forward and lateral [m/s], yaw rate [rad/s]."""
    slew: float = 1.0
    """How fast the command goes there [m/s or rad/s a second]; 0 is at once."""

    def __post_init__(self) -> None:
        check(self, seconds=POSITIVE, slew=NOT_NEGATIVE)


@dataclass(frozen=True, kw_only=True)
class PushSettings:
    """A constant force at the trunk's centre of mass."""

    start_s: float
    impulse: tuple[float, float]
    """Forward and to the left, in the heading at the start [N s]."""
    duration_s: float = 0.1

    def __post_init__(self) -> None:
        check(self, start_s=NOT_NEGATIVE, duration_s=POSITIVE)


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One thing that the robot is told to do."""

    segments: tuple[Segment, ...]
    measured_s: float
    """How much of the end figures are means over [s]."""
    required: bool = True
    """Whether it must be survived; the others are run and listed."""
    compared: bool = True
    """Whether engines must agree in its figures; survival is always compared where required."""
    velocity_error_m_s: float | None = None
    """Largest distance of the velocity from the last command; None is not asked."""
    yaw_rate_error_rad_s: float | None = None
    push: PushSettings | None = None

    def __post_init__(self) -> None:
        check(self, measured_s=POSITIVE, velocity_error_m_s=POSITIVE, yaw_rate_error_rad_s=POSITIVE)

    @property
    def seconds(self) -> float:
        return sum(segment.seconds for segment in self.segments)


@dataclass(frozen=True, kw_only=True)
class CrossEngineSettings:
    """The whole file."""

    simulation: SimulationSettings
    agreement: AgreementSettings
    cells: dict[str, Cell]
