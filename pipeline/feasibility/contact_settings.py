"""What contact is where nobody says it: the section `contact` of `data/feasibility.yaml`."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.feasibility.units import Metres, MetresPerSecond, Seconds
from pipeline.files.ranges import Range, check, increasing

_SPEED = Range(0.0, 5.0, open_low=True)


@dataclass(frozen=True, kw_only=True)
class ContactSettings:
    """A foot is on the ground where its sole is low and slow."""

    height: Metres
    """Its lowest corner is below this [m]."""
    on_speed: MetresPerSecond
    """Contact begins below this speed of the sole [m/s] ..."""
    off_speed: MetresPerSecond
    """... and ends above this [m/s]; a corner that is faster bears no force."""
    shortest_s: Seconds
    """Contacts and gaps that are shorter are not believed [s]."""

    def __post_init__(self) -> None:
        check(
            self,
            increasing(self, "on_speed", "off_speed"),
            height=Range(0.0, 0.2, open_low=True),
            on_speed=_SPEED,
            off_speed=_SPEED,
            shortest_s=Range(0.0, 1.0),
        )
