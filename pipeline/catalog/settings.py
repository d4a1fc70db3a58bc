"""Settings of the catalogue, read from `data/catalog.yaml`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pipeline.files.ranges import COUNT, NOT_NEGATIVE, PART, RATE_HZ, SHARE, Keys, Pattern, Range


@dataclass(frozen=True, kw_only=True)
class TimeBaseSettings:
    """When a frame rate is wrong, and what may stand in its place."""

    standard_rates_hz: Annotated[tuple[float, ...], RATE_HZ]
    """Rates at which motion is recorded or exported [Hz]."""
    gravity_ratio: Annotated[float, Range(1.0, 10.0, open_low=True)]
    """True rate over the file's rate (or the reverse) from which flights contradict the file."""
    gait_ratio: Annotated[float, Range(1.0, 10.0, open_low=True)]
    """The same for steps, where there are no flights."""
    certain_gait_ratio: Annotated[float, Range(1.0, 10.0, open_low=True)]
    """From here on steps alone are enough to call a rate wrong: people differ, gravity does not."""
    fewest_flights: Annotated[int, COUNT]
    """Flight phases that are needed to judge by gravity."""
    flight_spread: Annotated[float, PART]
    """Largest median deviation of the phases' fall from their median, as a share of it."""
    gravity_tolerance: Annotated[float, PART]
    """A standard rate explains the flights when it is within this share of what they tell."""
    gait_tolerance: Annotated[float, PART]
    """The same for the steps."""
    same_rate: Annotated[float, SHARE]
    """Standard rates this close to each other (24 and 25 Hz) are not distinguished: the nearest is taken."""
    usual_rates_hz: Annotated[dict[str, tuple[float, ...]], Keys(keys=Pattern(), values=RATE_HZ)]
    """Pattern of a skeleton's name -> rates at which its sources record [Hz]; they decide between several standard
    rates that explain the motion."""
    usual_ratio: Annotated[float, Range(1.0, 10.0, open_low=True)]
    """A file's rate this far from a usual one gives way to it when gravity or gait are nearer to that one."""
    fewest_steps: Annotated[int, COUNT]
    """Straight steps ahead that are needed to judge by gait."""
    shortest_step: Annotated[float, NOT_NEGATIVE]
    """Steps shorter than this share of the leg's length do not count: shuffling follows no rule."""


@dataclass(frozen=True, kw_only=True)
class CatalogSettings:
    """All of the catalogue."""

    velocity_s: Annotated[float, Range(0.01, 5.0)]
    """Width of the moving mean on the root's velocity [s]."""
    facing_s: Annotated[float, Range(0.01, 5.0)]
    """Width of the moving mean on the facing [s]."""
    bridge_s: Annotated[float, Range(0.0, 5.0)]
    """Longest gap of the recording that is interpolated before anything is measured [s]."""
    least_recorded_share: Annotated[float, SHARE]
    """Of the frames whose motion is known once gaps are bridged at least this share has to be recorded."""
    repeated_share: Annotated[float, PART]
    """Share of all moves from frame to frame that are in the pattern where frames are stored several times."""
    time_base: TimeBaseSettings
