"""The thresholds of KP5 as `data/feasibility.yaml` states them; there stand their values and sources."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pipeline.feasibility.balance_settings import BalanceSettings
from pipeline.files.ranges import NOT_NEGATIVE, POSITIVE, SHARE, Range, check

RATIO = Range(0.5, 5.0)
"""Of a robot's limit."""
SPEED = Range(0.0, 5.0)
LENGTH = Range(0.0, 1.0)
"""Of depths and ways at a foot [m]."""
ANGLE_DEG = Range(0.0, 180.0)
SECONDS = Range(0.0, 10.0)
CUTOFF_HZ = Range(1.0, 25.0)
"""Of low passes at the database's 50 Hz."""


@dataclass(frozen=True, kw_only=True)
class CutSettings:
    """What is done with bad stretches."""

    min_seconds: float
    """Shortest stretch that goes on [s]."""
    margin_s: float
    """Cut away with a bad frame on both sides [s]."""
    share_s: float
    """Shares of frames and percentiles over a shorter clip are taken as if the rest of this time had no fault [s]."""

    def __post_init__(self) -> None:
        check(self, min_seconds=Range(0.04, 60.0), margin_s=Range(0.0, 5.0), share_s=Range(0.0, 60.0))


@dataclass(frozen=True, kw_only=True)
class LikenessSettings:
    """Largest of KP3's figures of a clip, by the names they have there."""

    slip_m_s: float
    """Mean speed of the sole in stance, by the scorer's middle labels [m/s]."""
    drift_m: float
    """Drift within a stance [m]."""
    penetration_m: float
    """Deepest sole corner [m]."""
    height_shift_m: float
    """How far the clip as a whole stands off the ground [m]."""
    limb_error_deg: float
    """Mean angle of all limbs to the human's [deg]."""
    thigh_error_deg: float
    """Mean angle of the thighs [deg]."""
    shank_error_deg: float
    """Mean angle of the shanks [deg]."""
    trunk_error_deg: float
    """Mean angle of the trunk [deg]."""
    heading_error_deg: float
    """Mean angle of the pelvis heading [deg]."""

    def __post_init__(self) -> None:
        check(
            self,
            slip_m_s=SPEED,
            drift_m=LENGTH,
            penetration_m=LENGTH,
            height_shift_m=LENGTH,
            limb_error_deg=ANGLE_DEG,
            thigh_error_deg=ANGLE_DEG,
            shank_error_deg=ANGLE_DEG,
            trunk_error_deg=ANGLE_DEG,
            heading_error_deg=ANGLE_DEG,
        )


@dataclass(frozen=True, kw_only=True)
class JointSettings:
    """Positions, speeds and accelerations of joints."""

    limit_excess: float
    """Allowed beyond the robot's position limits [rad]."""
    speed_ratio: float
    """Largest speed over the motor's limit."""
    speed_over: float
    """A joint is well over its motor's speed where its speed over the limit is above this."""
    speed_over_share: float
    """Largest share of a joint's frames in which it is."""
    speed_over_run_s: float
    """Longest time it may be without a break [s]."""
    acceleration_p99: float
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
class Residual:
    """What no admissible contact force supplies."""

    force: float
    """Force over the weight."""
    lever: float
    """Horizontal moment over the weight [m]: how far outside the soles the centre of pressure would have to lie."""

    def __post_init__(self) -> None:
        check(self, force=POSITIVE, lever=Range(0.0, 2.0, open_low=True))


@dataclass(frozen=True, kw_only=True)
class TorqueSettings:
    """The torque a motion needs with the best admissible contact forces."""

    cutoff_hz: float
    """Low pass of the motion before accelerations are taken [Hz]."""
    friction: float
    """Coefficient of friction of the ground."""
    touch_height: float
    """A sole corner below this [m] may bear a force."""
    ratio: float
    """A joint is over its limit where torque over limit is above this."""
    over_share: float
    """Largest share of a joint's frames over its limit."""
    over_run_s: float
    """Longest time a joint may be over its limit without a break [s]."""
    consistent: Residual
    """A motion whose residual is below this in nine of ten frames is taken for dynamically consistent."""
    dynamic_residual: Residual
    """Largest mean residual over a window of a consistent motion."""
    reference_force: tuple[float, float]
    """Largest mean force residual over a window of another, a reference that can only be followed roughly, over the
    weight: a + b times the speed over ground [m/s]."""
    reference_lever: tuple[float, float]
    """The same of the lever [m]."""
    residual_window_s: float
    """Length of the window [s]."""

    def __post_init__(self) -> None:
        check(
            self,
            cutoff_hz=CUTOFF_HZ,
            friction=Range(0.05, 3.0),
            touch_height=Range(0.0, 0.2),
            ratio=RATIO,
            over_share=SHARE,
            over_run_s=SECONDS,
            reference_force=NOT_NEGATIVE,
            reference_lever=NOT_NEGATIVE,
            residual_window_s=Range(0.02, 10.0),
        )


@dataclass(frozen=True, kw_only=True)
class FootSettings:
    """Feet on the ground."""

    slip_mean: tuple[float, float]
    """Largest mean slip [m/s]: a + b times the speed over ground."""
    slip_p95: tuple[float, float]
    """Largest 95th percentile of slip [m/s]: a + b times the speed over ground."""
    penetration_p95: float
    """Largest 95th percentile over frames of the depth of the lowest corner [m]."""
    penetration_max: float
    """Deepest corner [m]."""
    floating: float
    """Largest height of the lowest corner of a foot in contact [m]."""
    flight_height: float
    """Both soles higher than this [m] is flight."""
    flight_s: float
    """Longest flight [s]."""
    disagreement: float
    """Largest share of foot-frames whose label says contact where the sole does not, or the other way."""

    def __post_init__(self) -> None:
        check(
            self,
            slip_mean=SPEED,
            slip_p95=SPEED,
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

    depth: float
    """Deepest overlap of two shapes [m]."""
    contact_depth: float
    """An overlap deeper than this [m] counts for the share."""
    share: float
    """Largest share of frames with such an overlap."""

    def __post_init__(self) -> None:
        check(self, depth=LENGTH, contact_depth=LENGTH, share=SHARE)


@dataclass(frozen=True, kw_only=True)
class RootSettings:
    """The root link, low-passed at `cutoff_hz`."""

    cutoff_hz: float
    """[Hz]"""
    height: tuple[float, float]
    """Lowest and highest root over the default root height."""
    tilt_deg: float
    """Largest angle from upright [deg]."""
    speed: float
    """Largest speed of the root [m/s]."""
    turn_speed: float
    """Largest angular speed of the root [rad/s]."""
    acceleration: float
    """Largest acceleration of the root [m/s^2]."""
    jerk: float
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
    feet: FootSettings
    collision: CollisionSettings
    root: RootSettings
    balance: BalanceSettings


def _two_grow(settings: Any, name: str) -> list[tuple[str, str]]:
    """A fault of a pair whose second number is not the larger one."""
    pair = getattr(settings, name, None)
    if not pair or len(pair) != 2 or None in pair or pair[0] < pair[1]:
        return []
    return [(f"{name}[1]", f"is {pair[1]:g}, allowed is more than the first ({pair[0]:g})")]
