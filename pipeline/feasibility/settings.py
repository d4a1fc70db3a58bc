"""The thresholds of KP5 as `data/feasibility.yaml` states them; there stand their values and sources."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class CutSettings:
    """What is done with bad stretches."""

    min_seconds: float
    """Shortest stretch that goes on [s]."""
    margin_s: float
    """Cut away with a bad frame on both sides [s]."""
    share_s: float
    """Shares of frames and percentiles over a shorter clip are taken as if the rest of this time had no fault [s]."""


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


@dataclass(frozen=True, kw_only=True)
class Residual:
    """What no admissible contact force supplies."""

    force: float
    """Force over the weight."""
    lever: float
    """Horizontal moment over the weight [m]: how far outside the soles the centre of pressure would have to lie."""


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


@dataclass(frozen=True, kw_only=True)
class CollisionSettings:
    """The robot against itself."""

    depth: float
    """Deepest overlap of two shapes [m]."""
    contact_depth: float
    """An overlap deeper than this [m] counts for the share."""
    share: float
    """Largest share of frames with such an overlap."""


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


@dataclass(frozen=True, kw_only=True)
class CommandSettings:
    """The cells of the command space that clips are balanced over."""

    forward: tuple[float, float, float]
    """Lowest, highest and width of cells [m/s]."""
    lateral: tuple[float, float, float]
    """[m/s]"""
    yaw_rate: tuple[float, float, float]
    """[rad/s]"""
    standing_m_s: float
    """Slower than this over ground [m/s] ..."""
    standing_rad_s: float
    """... and turning slower than this [rad/s] is standing."""


@dataclass(frozen=True, kw_only=True)
class BalanceSettings:
    """How feasible clips share the weight."""

    commands: CommandSettings
    cell_power: float
    """0: every second weighs the same; 1: every cell weighs the same."""
    max_ratio: float
    """Largest weight of a second over the mean weight of a second."""
    same_gait: float
    """Motions whose gait signatures differ by less than this [rad, root mean square] share a part of a cell."""
    smooth_jerk: float
    """Mean jerk [m/s^3] at which a clip's weight is halved."""
    missing_seconds: float
    """A cell with less than this [s] is missing."""


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
