"""Limits of a tracked rollout against the motion that it tracked: the section `tracking` of `data/feasibility.yaml`."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.feasibility.units import Metres, OfFrames, Plain, Radians, Seconds
from pipeline.files.ranges import SHARE, Range, check

_ANGLE = Range(0.0, 3.2, open_low=True)
_LENGTH = Range(0.0, 2.0, open_low=True)


@dataclass(frozen=True, kw_only=True)
class TrackingSettings:
    """How far a rollout may be from its reference, frame by frame at the same time."""

    followed: OfFrames
    """Least share of its reference that a rollout follows before tracking fails."""
    window_s: Seconds
    """The worst stretch of this length counts, and the last one [s]."""
    joint_p95: Radians
    """95th percentile over frames of the joints' root mean square error [rad]."""
    joint_worst: Radians
    """Largest mean of it over a window [rad]."""
    body_p95: Metres
    """95th percentile over frames of the error of the key body that is furthest off, relative to the root [m]."""
    body_worst: Metres
    """Largest mean of it over a window [m]."""
    growth: Metres
    """Largest difference of its mean over the last window and its median over windows [m]."""
    away_s: Seconds
    """Longest time in a row that it may be above `body_p95` [s]."""
    root_height: Metres
    """Largest difference of the root's height [m]."""
    gravity: Plain
    """Largest difference of the vertical in the root's frame, along its z axis."""
    end_height: Metres
    """Largest difference in height of a hand or a sole [m]."""

    def __post_init__(self) -> None:
        check(
            self,
            followed=SHARE,
            window_s=Range(0.02, 10.0),
            joint_p95=_ANGLE,
            joint_worst=_ANGLE,
            body_p95=_LENGTH,
            body_worst=_LENGTH,
            growth=_LENGTH,
            away_s=Range(0.0, 10.0),
            root_height=_LENGTH,
            gravity=Range(0.0, 2.0, open_low=True),
            end_height=_LENGTH,
        )
