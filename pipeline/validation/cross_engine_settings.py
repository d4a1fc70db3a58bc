"""Settings of `data/cross_engine.yaml`: the grid of cells. The thresholds are in `robots/<robot>/validation.yaml`."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.files.ranges import COUNT, NOT_NEGATIVE, POSITIVE, Range, check

LONGEST_TIMESTEP_S = 0.02
"""A figure is a mean over at least one timestep."""


@dataclass(frozen=True, kw_only=True)
class SimulationSettings:
    """Simulation settings common to all engines."""

    timestep_s: float
    friction: float
    seeds: int
    """Number of starts per cell; the first is exactly the default pose."""
    start_joint_pos: float
    """Half width of the other starts' joint positions about the default pose [rad]."""
    start_yaw: float
    """Half width of their heading [rad]."""

    def __post_init__(self) -> None:
        check(
            self,
            timestep_s=Range(0.0005, LONGEST_TIMESTEP_S),
            friction=POSITIVE,
            seeds=COUNT,
            start_joint_pos=Range(0.0, 0.2),
        )


@dataclass(frozen=True, kw_only=True)
class Segment:
    """A segment with one commanded velocity."""

    seconds: float
    command: tuple[float, float, float]
    """Forward and lateral [m/s], yaw rate [rad/s]."""
    slew: float = 1.0
    """Rate of the transition to the command [m/s^2 or rad/s^2]; 0: immediate."""

    def __post_init__(self) -> None:
        check(self, seconds=POSITIVE, slew=NOT_NEGATIVE)


@dataclass(frozen=True, kw_only=True)
class PushSettings:
    """A push by the model `force`: a constant force at the trunk's centre of mass."""

    start_s: float
    impulse: tuple[float, float]
    """Forward and to the left, in the heading at the start [N s]."""
    duration_s: float = 0.1

    def __post_init__(self) -> None:
        check(self, start_s=NOT_NEGATIVE, duration_s=POSITIVE)


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One cell: commands, measured time, and an optional push."""

    segments: tuple[Segment, ...]
    measured_s: float
    """Length of the end over which means are taken [s], within the last segment."""
    push: PushSettings | None = None

    def __post_init__(self) -> None:
        check(self, _beyond(self), measured_s=Range(LONGEST_TIMESTEP_S))

    @property
    def seconds(self) -> float:
        return sum(segment.seconds for segment in self.segments)


def _beyond(cell: Cell) -> list[tuple[str, str]]:
    """Faults: measured time longer than the last segment, a push after the end."""
    segments = getattr(cell, "segments", None)
    if segments is None or None in segments:
        return []
    if not segments:
        return [("segments", "is empty, allowed is at least one")]
    faults, last_s, whole_s = [], segments[-1].seconds, sum(each.seconds for each in segments)
    measured_s, push = getattr(cell, "measured_s", None), getattr(cell, "push", None)
    if measured_s is not None and measured_s > last_s:
        faults.append(("measured_s", f"is {measured_s:g}, allowed is at most the last segment's {last_s:g} s"))
    if push is not None and push.start_s + push.duration_s > whole_s + 1e-9:
        end_s = push.start_s + push.duration_s
        faults.append(
            ("push.start_s", f"is {push.start_s:g}, its end at {end_s:g} s is after the cell's {whole_s:g} s")
        )
    return faults


@dataclass(frozen=True, kw_only=True)
class CrossEngineSettings:
    """The whole file."""

    simulation: SimulationSettings
    cells: dict[str, Cell]
