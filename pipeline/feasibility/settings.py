"""The thresholds of KP5 as `data/feasibility.yaml` states them; there stand their values and sources.

A number's type is its unit, which the file has to say too (`pipeline.files.sourced`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from pipeline.feasibility.balance_settings import BalanceSettings
from pipeline.feasibility.cut_settings import CutSettings
from pipeline.feasibility.likeness_settings import LikenessSettings
from pipeline.feasibility.torque_settings import CUTOFF_HZ, RATIO, SECONDS, TorqueSettings
from pipeline.feasibility.tracking_settings import TrackingSettings
from pipeline.feasibility.units import (
    Degrees,
    Hertz,
    Metres,
    MetresPerSecond,
    MetresPerSecondBySpeed,
    MetresPerSecondCubed,
    OfFrames,
    OfMotorLimit,
    Radians,
    RadiansPerSecond,
    Seconds,
    SecondsBySpeed,
)
from pipeline.files.ranges import POSITIVE, SHARE, Range, check
from pipeline.files.sourced import Unit
from pipeline.quality.sole_contact import ContactSettings

SPEED = Range(0.0, 5.0)
LENGTH = Range(0.0, 1.0)
"""Of depths and ways at a foot [m]."""
ANGLE_DEG = Range(0.0, 180.0)


@dataclass(frozen=True, kw_only=True)
class JointSettings:
    """Positions, speeds and accelerations of joints."""

    limit_excess: Radians
    """Allowed beyond the robot's position limits [rad]."""
    speed_ratio: OfMotorLimit
    """Largest speed over the motor's limit."""
    speed_over: OfMotorLimit
    """A joint is well over its motor's speed where its speed over the limit is above this."""
    speed_over_share: OfFrames
    """Largest share of a joint's frames in which it is."""
    speed_over_run_s: Seconds
    """Longest time it may be without a break [s]."""
    acceleration_p99: Annotated[float, Unit("rad/s^2")]
    """99th percentile over all frames and joints, low-passed [rad/s^2]."""

    def __post_init__(self) -> None:
        check(
            self,
            limit_excess=Range(0.0, 1.0),
            speed_ratio=RATIO,
            speed_over=RATIO,
            speed_over_share=SHARE,
            speed_over_run_s=SECONDS,
            acceleration_p99=POSITIVE,
        )


@dataclass(frozen=True, kw_only=True)
class FootSettings:
    """Feet on the ground."""

    level: Metres
    """Corners of a sole that lie by less than this above its lowest one are on the ground with it [m]."""
    slip_mean: MetresPerSecondBySpeed
    """Largest mean slip of feet that are labelled as in contact [m/s]: a + b times the speed over ground."""
    told_slip_mean: MetresPerSecondBySpeed
    """The same of feet that the soles tell to be, the slower of two [m/s], in motion with labels or without."""
    slip_p95: MetresPerSecondBySpeed
    """Largest 95th percentile of slip [m/s]: a + b times the speed over ground."""
    glide_s: SecondsBySpeed
    """Longest time that feet near the ground may be too fast to stand, where nothing is labelled [s]: a + b times the
    speed over ground about that time."""
    penetration_p95: Metres
    """Largest 95th percentile over frames of the depth of the lowest corner [m]."""
    penetration_max: Metres
    """Deepest corner [m]."""
    floating: Metres
    """Largest height of the lowest corner of a foot in contact [m]."""
    flight_height: Metres
    """Both soles higher than this [m] is flight."""
    flight_s: Seconds
    """Longest flight [s]."""
    disagreement: Annotated[float, Unit("of foot-frames")]
    """Largest share of foot-frames whose label says contact where the sole does not, or the other way."""

    def __post_init__(self) -> None:
        check(
            self,
            level=LENGTH,
            slip_mean=SPEED,
            told_slip_mean=SPEED,
            slip_p95=SPEED,
            glide_s=SECONDS,
            penetration_p95=LENGTH,
            penetration_max=LENGTH,
            floating=LENGTH,
            flight_height=LENGTH,
            flight_s=SECONDS,
            disagreement=SHARE,
        )


@dataclass(frozen=True, kw_only=True)
class CollisionSettings:
    """The robot against itself."""

    depth: Metres
    """Deepest overlap of two shapes [m]."""
    contact_depth: Metres
    """An overlap deeper than this [m] counts for the share."""
    share: OfFrames
    """Largest share of frames with such an overlap."""

    def __post_init__(self) -> None:
        check(self, depth=LENGTH, contact_depth=LENGTH, share=SHARE)


@dataclass(frozen=True, kw_only=True)
class RootSettings:
    """The root link, low-passed at `cutoff_hz`."""

    cutoff_hz: Hertz
    """[Hz]"""
    height: Annotated[tuple[float, float], Unit("of the standing height")]
    """Lowest and highest root over the default root height."""
    tilt_deg: Degrees
    """Largest angle from upright [deg]."""
    speed: MetresPerSecond
    """Largest speed of the root [m/s]."""
    turn_speed: RadiansPerSecond
    """Largest angular speed of the root [rad/s]."""
    acceleration: Annotated[float, Unit("m/s^2")]
    """Largest acceleration of the root [m/s^2]."""
    jerk: MetresPerSecondCubed
    """Largest mean jerk of the root [m/s^3]."""

    def __post_init__(self) -> None:
        check(
            self,
            _two_grow(self, "height"),
            cutoff_hz=CUTOFF_HZ,
            height=Range(0.0, 3.0),
            tilt_deg=ANGLE_DEG,
            speed=Range(0.0, 15.0, open_low=True),
            turn_speed=POSITIVE,
            acceleration=POSITIVE,
            jerk=POSITIVE,
        )


@dataclass(frozen=True, kw_only=True)
class FeasibilitySettings:
    """`data/feasibility.yaml`."""

    cut: CutSettings
    likeness: LikenessSettings
    joints: JointSettings
    torque: TorqueSettings
    contact: ContactSettings
    feet: FootSettings
    collision: CollisionSettings
    root: RootSettings
    tracking: TrackingSettings
    balance: BalanceSettings


def _two_grow(settings: Any, name: str) -> list[tuple[str, str]]:
    """A fault of a pair whose second number is not the larger one."""
    pair = getattr(settings, name, None)
    if not pair or len(pair) != 2 or None in pair or pair[0] < pair[1]:
        return []
    return [(f"{name}[1]", f"is {pair[1]:g}, allowed is more than the first ({pair[0]:g})")]
