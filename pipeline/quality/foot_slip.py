"""Foot slip: speed of the sole's lowest corner while in contact.

Sources know three: the speed of the ankle, of the sole's centre, of a corner. Here it is the horizontal speed
of the sole's lowest corner while the foot is in contact, which is 0 for a foot that rolls over heel and toe.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from pipeline.quality.percentile import percentile_of_least
from pipeline.quality.sole import SoleMotion


@dataclass(frozen=True, kw_only=True)
class FootSlip:
    """Slip over all foot-frames in contact [m/s]; 0 without contact."""

    mean: float
    p95: float


def lowest_corner_slip(sole: SoleMotion, contacts: Bool[np.ndarray, "t 2"], least_frames: int = 0) -> FootSlip:
    """Horizontal speed of the lowest corner of feet in contact.

    The percentile of fewer than `least_frames` foot-frames is taken as if the rest of them did not slide.
    """
    speed = sole.lowest_corner_speed[inner_contacts(contacts)]
    if speed.size == 0:
        return FootSlip(mean=0.0, p95=0.0)
    return FootSlip(mean=float(speed.mean()), p95=percentile_of_least(speed, 95, least_frames))


def inner_contacts(contacts: Bool[np.ndarray, "t 2"]) -> Bool[np.ndarray, "t 2"]:
    """Contacts without the first and last frame of each, where central differences include the swing."""
    inner = contacts.copy()
    inner[1:] &= contacts[:-1]
    inner[:-1] &= contacts[1:]
    return inner
