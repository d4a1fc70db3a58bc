"""Settings of the catalogue, read from `data/catalog.yaml`."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.files.ranges import COUNT, NOT_NEGATIVE, PART, RATE_HZ, SHARE, Keys, Pattern, Range, check


@dataclass(frozen=True, kw_only=True)
class TimeBaseSettings:
    """When a frame rate is wrong, and what may stand in its place."""

    standard_rates_hz: tuple[float, ...]
    """Rates at which motion is recorded or exported [Hz]."""
    gravity_ratio: float
    """True rate over the file's rate (or the reverse) from which flights contradict the file."""
    gait_ratio: float
    """The same for steps, where there are no flights."""
    certain_gait_ratio: float
    """From here on steps alone are enough to call a rate wrong: people differ, gravity does not."""
    fewest_flights: int
    """Flight phases that are needed to judge by gravity."""
    flight_spread: float
    """Largest median deviation of the phases' fall from their median, as a share of it."""
    gravity_tolerance: float
    """A standard rate explains the flights when it is within this share of what they tell."""
    gait_tolerance: float
    """The same for the steps."""
    same_rate: float
    """Standard rates this close to each other (24 and 25 Hz) are not distinguished: the nearest is taken."""
    usual_rates_hz: dict[str, tuple[float, ...]]
    """Pattern of a skeleton's name -> rates at which its sources record [Hz]; they decide between several standard
    rates that explain the motion."""
    usual_ratio: float
    """A file's rate this far from a usual one gives way to it when gravity or gait are nearer to that one."""
    fewest_steps: int
    """Straight steps ahead that are needed to judge by gait."""
    shortest_step: float
    """Steps shorter than this share of the leg's length do not count: shuffling follows no rule."""

    def __post_init__(self) -> None:
        ratio = Range(1.0, 10.0, open_low=True)
        check(
            self,
            standard_rates_hz=RATE_HZ,
            gravity_ratio=ratio,
            gait_ratio=ratio,
            certain_gait_ratio=ratio,
            fewest_flights=COUNT,
            flight_spread=PART,
            gravity_tolerance=PART,
            gait_tolerance=PART,
            same_rate=SHARE,
            usual_rates_hz=Keys(keys=Pattern(), values=RATE_HZ),
            usual_ratio=ratio,
            fewest_steps=COUNT,
            shortest_step=NOT_NEGATIVE,
        )


@dataclass(frozen=True, kw_only=True)
class CatalogSettings:
    """All of the catalogue."""

    velocity_s: float
    """Width of the moving mean on the root's velocity [s]."""
    facing_s: float
    """Width of the moving mean on the facing [s]."""
    bridge_s: float
    """Longest gap of the recording that is interpolated before anything is measured [s]."""
    least_recorded_share: float
    """Of the frames whose motion is known once gaps are bridged at least this share has to be recorded."""
    repeated_share: float
    """Share of all moves from frame to frame that are in the pattern where frames are stored several times."""
    time_base: TimeBaseSettings

    def __post_init__(self) -> None:
        seconds = Range(0.01, 5.0)
        check(
            self,
            velocity_s=seconds,
            facing_s=seconds,
            bridge_s=Range(0.0, 5.0),
            least_recorded_share=SHARE,
            repeated_share=PART,
        )
