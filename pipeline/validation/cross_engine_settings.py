"""Settings of `data/cross_engine.yaml`: the grid of cells. The thresholds are in `robots/<robot>/validation.yaml`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pipeline.files.ranges import COUNT, NOT_NEGATIVE, POSITIVE, Range, check

LONGEST_TIMESTEP_S = 0.02
"""A figure is a mean over at least one timestep."""


@dataclass(frozen=True, kw_only=True)
class SimulationSettings:
    """Simulation settings common to all engines."""

    timestep_s: Annotated[float, Range(0.0005, LONGEST_TIMESTEP_S)]
    friction: Annotated[float, POSITIVE]
    seeds: Annotated[int, COUNT]
    """Number of starts per cell; the first is exactly the default pose."""
    start_joint_pos: Annotated[float, Range(0.0, 0.2)]
    """Half width of the other starts' joint positions about the default pose [rad]."""
    start_yaw: float
    """Half width of their heading [rad]."""


@dataclass(frozen=True, kw_only=True)
class Segment:
    """A segment with one commanded velocity."""

    seconds: Annotated[float, POSITIVE]
    command: tuple[float, float, float]
    """Forward and lateral [m/s], yaw rate [rad/s]."""
    slew: Annotated[float, NOT_NEGATIVE] = 1.0
    """Rate of the transition to the command [m/s^2 or rad/s^2]; 0: immediate."""


@dataclass(frozen=True, kw_only=True)
class PushSettings:
    """A push by the model `force`: a constant force at the trunk's centre of mass."""

    start_s: Annotated[float, NOT_NEGATIVE]
    impulse: tuple[float, float]
    """Forward and to the left, in the heading at the start [N s]."""
    duration_s: Annotated[float, POSITIVE] = 0.1


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One cell: commands, measured time, and an optional push."""

    segments: tuple[Segment, ...]
    measured_s: Annotated[float, Range(LONGEST_TIMESTEP_S)]
    """Length of the end over which means are taken [s], within the last segment."""
    push: PushSettings | None = None

    def __post_init__(self) -> None:
        check(_beyond(self))

    @property
    def seconds(self) -> float:
        return sum(segment.seconds for segment in self.segments)


def _beyond(cell: Cell) -> list[tuple[str, str]]:
    """Faults: measured time longer than the last segment, a push after the end."""
    segments, measured_s, push = cell.segments, cell.measured_s, cell.push
    if not segments:
        return [("segments", "is empty, allowed is at least one")]
    faults, last_s, whole_s = [], segments[-1].seconds, sum(each.seconds for each in segments)
    if measured_s > last_s:
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
