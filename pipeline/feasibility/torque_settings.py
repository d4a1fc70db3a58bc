"""The part of `data/feasibility.yaml` that torque and balance are held against."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pipeline.feasibility.units import Hertz, Metres, MetresPerSecondBySpeed, OfFrames, OfWeight, Plain, Seconds
from pipeline.files.ranges import NOT_NEGATIVE, POSITIVE, SHARE, Range, check
from pipeline.files.sourced import Unit

RATIO = Range(0.5, 5.0)
"""Of a robot's limit."""
SECONDS = Range(0.0, 10.0)
CUTOFF_HZ = Range(1.0, 25.0)
"""Of low passes at the database's 50 Hz."""


@dataclass(frozen=True, kw_only=True)
class Residual:
    """What no admissible contact force supplies."""

    force: OfWeight
    """Force over the weight."""
    lever: Metres
    """Horizontal moment over the weight [m]: how far outside the soles the centre of pressure would have to lie."""

    def __post_init__(self) -> None:
        check(self, force=POSITIVE, lever=Range(0.0, 2.0, open_low=True))


@dataclass(frozen=True, kw_only=True)
class Allowance:
    """What a motion that contact forces do not explain may ask of a motor, over its torque limit.

    Each ratio is a + b times the speed over ground [m/s].
    """

    motor: Annotated[tuple[float, float], Unit("of the torque limit")]
    """Of any motor that is not one of the two below."""
    roll: Annotated[tuple[float, float], Unit("of the torque limit")]
    """Of a leg's joints that turn about the forward axis: they shift the centre of pressure sideways."""
    ankle: Annotated[tuple[float, float], Unit("of the torque limit")]
    """Of the other joints below the shank: they shift it forwards."""


@dataclass(frozen=True, kw_only=True)
class ReferenceNeed(Allowance):
    """What it may ask for a moment, the root first, whatever the limits."""

    run_s: Seconds
    """Longest time that a motor may need more without a break [s]."""

    def __post_init__(self) -> None:
        check(self, motor=NOT_NEGATIVE, roll=NOT_NEGATIVE, ankle=NOT_NEGATIVE, run_s=SECONDS)


@dataclass(frozen=True, kw_only=True)
class LastingNeed(Allowance):
    """What it may ask of one motor on average over a while, where all others keep to their limits."""

    mean_s: Seconds
    """The while [s]."""
    speed_s: Seconds
    """The speed over ground is a mean over this time [s]."""
    most: Annotated[float, Unit("of what is allowed")]
    """Largest need over what is allowed."""

    def __post_init__(self) -> None:
        check(
            self,
            motor=NOT_NEGATIVE,
            roll=NOT_NEGATIVE,
            ankle=NOT_NEGATIVE,
            mean_s=Range(0.0, 2.0, open_low=True),
            speed_s=Range(0.0, 2.0, open_low=True),
            most=RATIO,
        )


@dataclass(frozen=True, kw_only=True)
class TorqueSettings:
    """The torque a motion needs with the best admissible contact forces."""

    cutoff_hz: Hertz
    """Low pass of the motion before accelerations are taken [Hz]."""
    friction: Plain
    """Coefficient of friction of the ground."""
    touch_height: Metres
    """A sole corner below this [m] may bear a force."""
    mean_s: Seconds
    """Torque is held against its limit as a mean over this time [s]."""
    ratio: Annotated[float, Unit("of the torque limit")]
    """A joint is over its limit where that over the limit is above this."""
    peak_ratio: Annotated[float, Unit("of the torque limit")]
    """Largest torque over the limit, however short."""
    over_share: OfFrames
    """Largest share of a joint's frames over its limit."""
    over_run_s: Seconds
    """Longest time a joint may be over its limit without a break [s]."""
    label_reach_s: Seconds
    """A force is sought this long before and after a contact, as accelerations are over three frames [s] ..."""
    told_reach_s: Annotated[tuple[float, float], Unit("s")]
    """... and this long before and this long after [s] where contacts may begin and end a frame late or early: where
    they are told from the soles, and for the torque of a motion that contact forces explain also where they are
    labelled."""
    told_speed: MetresPerSecondBySpeed
    """A corner that is faster bears no force there [m/s]: a + b times the speed over ground about that time [m/s]."""
    strict_excess: Plain
    """Cost of torque past a limit against the root's residual where a motion is taken at its word ..."""
    reference_excess: Plain
    """... and where its limits come first."""
    consistent: Residual
    """A motion whose residual is below this ..."""
    consistent_share: OfFrames
    """... in that share of the frames is dynamically consistent: one fault in it does not make a reference."""
    dynamic_residual: Residual
    """Largest mean residual over a window of a consistent motion."""
    reference_force: Annotated[tuple[float, float], Unit("of the weight")]
    """Largest mean force residual over a window of another, a reference that can only be followed roughly, over the
    weight: a + b times the speed over ground [m/s]."""
    reference_lever: Annotated[tuple[float, float], Unit("m")]
    """The same of the lever [m]."""
    residual_window_s: Seconds
    """Length of the window [s]."""
    reference_need: ReferenceNeed
    """What such a reference may ask of the motors for a moment ..."""
    lasting_need: LastingNeed
    """... and what for longer."""

    def __post_init__(self) -> None:
        check(
            self,
            cutoff_hz=CUTOFF_HZ,
            friction=Range(0.05, 3.0),
            touch_height=Range(0.0, 0.2),
            mean_s=Range(0.0, 0.5),
            ratio=RATIO,
            peak_ratio=RATIO,
            over_share=SHARE,
            over_run_s=SECONDS,
            label_reach_s=Range(0.0, 0.5),
            told_reach_s=Range(0.0, 0.5),
            told_speed=Range(0.0, 5.0),
            strict_excess=Range(0.0, 100.0, open_low=True),
            reference_excess=Range(0.0, 1000.0, open_low=True),
            consistent_share=SHARE,
            reference_force=NOT_NEGATIVE,
            reference_lever=NOT_NEGATIVE,
            residual_window_s=Range(0.02, 10.0),
        )
