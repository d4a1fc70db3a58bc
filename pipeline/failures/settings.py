"""What counts as a failure, as `data/failures.yaml` states it; there stand the values and their sources."""

from dataclasses import dataclass
from typing import Annotated

from pipeline.files.ranges import PART, POSITIVE, SHARE, Range, check, increasing
from pipeline.files.sourced import SPEED, SPEED_AND_SHARE, TORQUE
from pipeline.robot.size import RobotSize


@dataclass(frozen=True, kw_only=True)
class FallSettings:
    """Falls, by attitude and by what the robot says."""

    tilt_deg: float
    """A trunk tilted further has fallen."""
    onset_deg: float
    """A fall begins when the tilt was last below this."""
    flag_s: float
    """Attitude and the robot's own message tell the same fall when they are closer than this [s]."""
    push_m_s2: float
    """Horizontal acceleration that is a push."""
    push_width_s: Annotated[float, POSITIVE]
    """... averaged over this time [s]."""
    push_m_s: Annotated[float, SPEED]
    """Least change of velocity by a push."""
    cause_s: float
    """A push so long before a fall is its cause [s]."""

    def __post_init__(self) -> None:
        check(increasing(self, "onset_deg", "tilt_deg"))


@dataclass(frozen=True, kw_only=True)
class ExcuseSettings:
    """When a robot is held by hand or stopped."""

    support: Annotated[float, PART]
    """Feet that bear less than this share of the weight don't hold the robot."""
    specific_force: Annotated[float, PART]
    """A trunk that feels more than this share of gravity does not fall freely."""
    window_s: Annotated[float, POSITIVE]
    """Both as means over this time [s]."""
    short_s: float
    """... or over this one, for as long, where the robot is tipped meanwhile [s]."""
    after_s: float
    """So long after it was let go a failure is the holder's [s]."""
    before_s: float
    """So long before as well [s]."""
    damping_kp: Annotated[float, PART]
    """Stiffness below this share of the usual one stops the robot."""


@dataclass(frozen=True, kw_only=True)
class StumbleSettings:
    """A robot that nearly fell."""

    tilt_deg: float
    rate: float
    """Of roll and pitch [rad/s], mean over 0.1 s."""
    settle_s: float
    """Of two within this time only the first is reported [s]."""


@dataclass(frozen=True, kw_only=True)
class SlipSettings:
    """Feet that slide while they bear the robot."""

    foot_m_s: Annotated[float, SPEED, POSITIVE]
    """Speed of a bearing sole over the ground [m/s]."""
    share: Annotated[float, PART]
    """Share of a window."""
    window_s: Annotated[float, POSITIVE]


@dataclass(frozen=True, kw_only=True)
class TorqueSettings:
    """Motors that give less torque than commanded."""

    asked_over: Annotated[float, PART]
    """Asked less given, over the limit."""
    run_s: float
    """Shortest stretch that counts [s]."""
    least_s: float
    """Least sum of such stretches [s]."""
    spread: Annotated[float, PART]
    """Largest spread (1.48 MAD) of what was given, over its median."""
    at_limit: Annotated[float, PART]
    """Plateaus above this share of the calibrated limit are that limit."""
    nominal_share: Annotated[float, PART]
    """Share of a window at the calibrated limit."""
    window_s: Annotated[float, POSITIVE]


@dataclass(frozen=True, kw_only=True)
class SpeedSettings:
    """Joints faster than their motors."""

    ratio: float
    share: Annotated[float, PART]
    window_s: Annotated[float, POSITIVE]


@dataclass(frozen=True, kw_only=True)
class AuthoritySettings:
    """Motors that do not answer, and joints that are only damped after a fall."""

    asked_over: Annotated[float, PART]
    """Asked torque over the limit from which a motor has to answer ..."""
    least_torque: Annotated[float, TORQUE, POSITIVE]
    """... and the least one [N m]: friction may hide what a motor gives at smaller commands."""
    dead_share: Annotated[float, PART]
    """A motor that gives less than this share of the command does not answer."""
    alive_share: Annotated[float, PART]
    """One that gives more than this share of the command, or of its limit, does."""
    error_rad: Annotated[float, POSITIVE]
    """Distance of a joint from its target that a motor with authority does not leave [rad]."""
    flicker_s: Annotated[tuple[float, float], POSITIVE]
    """Shortest and longest time for which motors flicker [s]; longer is a loss of authority."""
    damped_share: Annotated[float, PART]
    """Asked torque by stiffness over the usual one, below which joints are only damped."""
    damped_s: Annotated[float, POSITIVE]
    """... for at least this time [s]."""

    def __post_init__(self) -> None:
        check(increasing(self, "dead_share", "alive_share"))


@dataclass(frozen=True, kw_only=True)
class HeatSettings:
    """Hot motors."""

    temperature_c: float
    rise_s: float


@dataclass(frozen=True, kw_only=True)
class PacketSettings:
    """Motors and messages that are not heard."""

    lost_hz: float
    gap_s: float
    window_s: float


@dataclass(frozen=True, kw_only=True)
class TrackingSettings:
    """Commanded against achieved velocity."""

    steady_s: Annotated[float, POSITIVE]
    settle_s: Annotated[float, Range(0.0, 30.0)]
    forward: Annotated[tuple[float, float], SPEED_AND_SHARE]
    """Largest difference: a [m/s] + b times the command."""
    lateral: Annotated[tuple[float, float], SPEED_AND_SHARE]
    yaw: tuple[float, float]
    """[rad/s]"""
    delay_s: float
    """A delay from target to torque above this is named as the cause [s]."""
    longest_delay_s: Annotated[float, Range(0.0, 1.0)]


@dataclass(frozen=True, kw_only=True)
class LimitCycleSettings:
    """The gait against that of the simulation."""

    deviation: Annotated[float, SHARE]
    """RMS over the phase, over the joint's range in simulation."""


@dataclass(frozen=True, kw_only=True)
class FailureSettings:
    """`data/failures.yaml`."""

    calibrated_on: RobotSize
    """The robot that speeds and torques hold for; `pipeline.robot.size.scaled` gives those of another one."""
    fall: FallSettings
    excuse: ExcuseSettings
    stumble: StumbleSettings
    slip: SlipSettings
    torque: TorqueSettings
    speed: SpeedSettings
    authority: AuthoritySettings
    heat: HeatSettings
    packets: PacketSettings
    tracking: TrackingSettings
    limit_cycle: LimitCycleSettings
