"""Foot contacts inferred from sole kinematics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Bool

from pipeline import time_series
from pipeline.files.ranges import Range, check, increasing
from pipeline.files.sourced import Unit
from pipeline.quality.sole import SoleMotion

_SPEED = Range(0.0, 5.0, open_low=True)


@dataclass(frozen=True, kw_only=True)
class ContactSettings:
    """A foot is in contact if its sole is low and slow: the section `contact` of `data/feasibility.yaml`, and of
    `data/augment.yaml`."""

    height: Annotated[float, Range(0.0, 0.2, open_low=True), Unit("m")]
    """Largest height of the lowest corner [m]."""
    on_speed: Annotated[float, _SPEED, Unit("m/s")]
    """Contact begins below this speed of the sole [m/s] ..."""
    off_speed: Annotated[float, _SPEED, Unit("m/s")]
    """... and ends above this [m/s]."""
    shortest_s: Annotated[float, Range(0.0, 1.0), Unit("s")]
    """Contacts and gaps shorter than this are ignored [s]."""

    def __post_init__(self) -> None:
        check(increasing(self, "on_speed", "off_speed"))


def contact_from_sole(sole: SoleMotion, settings: ContactSettings) -> Bool[np.ndarray, "t 2"]:
    """Contact of the left and right foot: low and slow, with hysteresis.

    Gaps shorter than `settings.shortest_s` are closed first, then short contacts dropped.
    """
    low, speed = sole.height < settings.height, sole.mean_speed
    contact = np.zeros(low.shape, dtype=bool)
    state = np.zeros(2, dtype=bool)
    for frame in range(len(low)):
        state = low[frame] & (speed[frame] < np.where(state, settings.off_speed, settings.on_speed))
        contact[frame] = state
    shortest = round(settings.shortest_s * sole.fps)
    for side in range(2):
        for wanted in (False, True):
            for start, stop in time_series.runs(contact[:, side] == wanted):
                if stop - start < shortest and start > 0 and stop < len(contact):
                    contact[start:stop, side] = not wanted
    return contact
