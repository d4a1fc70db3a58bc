"""Thresholds of failures, read from `data/failures.yaml`, which has the values and their sources."""

from dataclasses import dataclass
from typing import Annotated

from pipeline.files.ranges import PART, POSITIVE, SHARE, Range, check, increasing
from pipeline.files.sourced import SPEED, SPEED_AND_SHARE, TORQUE
from pipeline.robot.size import RobotSize


@dataclass(frozen=True, kw_only=True)
class FallSettings:
    """Falls, from attitude and the robot's fall state."""

    tilt_deg: float
    """Tilt of the trunk above which the robot has fallen."""
    onset_deg: float
    """Tilt at the onset of a fall: the last sample below this."""
    flag_s: float
    """Largest time between attitude and fall state for one fall [s]."""
    push_m_s2: float
    """Horizontal acceleration of a push."""
    push_width_s: Annotated[float, POSITIVE]
    """Averaging time of that acceleration [s]."""
    push_m_s: Annotated[float, SPEED]
    """Least velocity change of a push."""
    cause_s: float
    """Largest time between a push and the fall that it causes [s]."""

    def __post_init__(self) -> None:
        check(increasing(self, "onset_deg", "tilt_deg"))


@dataclass(frozen=True, kw_only=True)
class ExcuseSettings:
    """Detection of a robot that is held by hand or stopped."""

    support: Annotated[float, PART]
    """Share of the weight on the feet below which they do not support the robot."""
    specific_force: Annotated[float, PART]
    """Specific force of the trunk, as a share of gravity, above which it is not in free fall."""
    window_s: Annotated[float, POSITIVE]
    """Averaging time of both [s]."""
    short_s: float
    """Averaging time and least duration if the robot is tipped meanwhile [s]."""
    after_s: float
    """Time after the release for which failures are excused [s]."""
    before_s: float
    """Time before the robot is held for which failures are excused [s]."""
    damping_kp: Annotated[float, PART]
    """Share of the usual stiffness below which the robot is stopped."""


@dataclass(frozen=True, kw_only=True)
class StumbleSettings:
    """Near falls."""

    tilt_deg: float
    rate: float
    """Roll or pitch rate of a stumble, mean over 0.1 s [rad/s]."""
    settle_s: float
    """Time after a stumble in which no further one is reported [s]."""


@dataclass(frozen=True, kw_only=True)
class SlipSettings:
    """Loaded feet that slide."""

    foot_m_s: Annotated[float, SPEED, POSITIVE]
    """Horizontal speed of a loaded sole that is a slip [m/s]."""
    share: Annotated[float, PART]
    """Share of a window in which a sole slips."""
    window_s: Annotated[float, POSITIVE]


@dataclass(frozen=True, kw_only=True)
class TorqueSettings:
    """Motors that produce less torque than commanded."""

    asked_over: Annotated[float, PART]
    """Commanded minus produced torque, relative to the limit."""
    run_s: float
    """Shortest stretch that is used [s]."""
    least_s: float
    """Least total duration of such stretches [s]."""
    spread: Annotated[float, PART]
    """Largest spread (1.48 MAD) of the produced torque relative to its median, for a plateau."""
    at_limit: Annotated[float, PART]
    """Share of the calibrated limit above which a plateau is that limit."""
    nominal_share: Annotated[float, PART]
    """Share of a window at the calibrated limit that is a failure."""
    window_s: Annotated[float, POSITIVE]


@dataclass(frozen=True, kw_only=True)
class SpeedSettings:
    """Joints faster than their motors."""

    ratio: float
    share: Annotated[float, PART]
    window_s: Annotated[float, POSITIVE]


@dataclass(frozen=True, kw_only=True)
class AuthoritySettings:
    """Unresponsive motors, and joints that are only damped after a fall."""

    asked_over: Annotated[float, PART]
    """Commanded torque relative to the limit above which a motor must respond."""
    least_torque: Annotated[float, TORQUE, POSITIVE]
    """Least such commanded torque [N m]; friction may hide the response to smaller ones."""
    dead_share: Annotated[float, PART]
    """Share of the commanded torque below which a motor is unresponsive."""
    alive_share: Annotated[float, PART]
    """Share of the commanded torque, or of the limit, above which a motor is responsive."""
    error_rad: Annotated[float, POSITIVE]
    """Error of a joint to its target above which it is far from it [rad]."""
    flicker_s: Annotated[tuple[float, float], POSITIVE]
    """Shortest and longest duration of a motor flicker [s]; longer is a loss of authority."""
    damped_share: Annotated[float, PART]
    """Stiffness torque relative to the usual one below which joints are only damped."""
    damped_s: Annotated[float, POSITIVE]
    """Least duration of damping [s]."""

    def __post_init__(self) -> None:
        check(increasing(self, "dead_share", "alive_share"))


@dataclass(frozen=True, kw_only=True)
class HeatSettings:
    """Hot motors."""

    temperature_c: float
    rise_s: float


@dataclass(frozen=True, kw_only=True)
class PacketSettings:
    """Lost motor packets and log messages."""

    lost_hz: float
    gap_s: float
    window_s: float


@dataclass(frozen=True, kw_only=True)
class TrackingSettings:
    """Difference between commanded and achieved velocity."""

    steady_s: Annotated[float, POSITIVE]
    settle_s: Annotated[float, Range(0.0, 30.0)]
    forward: Annotated[tuple[float, float], SPEED_AND_SHARE]
    """Largest difference of the linear velocity: a [m/s] + b times the command."""
    lateral: Annotated[tuple[float, float], SPEED_AND_SHARE]
    yaw: tuple[float, float]
    """Largest difference of the yaw rate: a [rad/s] + b times the command."""
    delay_s: float
    """Delay from target to torque above which it is reported as the cause [s]."""
    longest_delay_s: Annotated[float, Range(0.0, 1.0)]


@dataclass(frozen=True, kw_only=True)
class LimitCycleSettings:
    """Difference of the gait to the simulated one."""

    deviation: Annotated[float, SHARE]
    """RMS difference over the phase, relative to the joint's range in simulation."""


@dataclass(frozen=True, kw_only=True)
class FailureSettings:
    """`data/failures.yaml`."""

    calibrated_on: RobotSize
    """Robot that speeds and torques are valid for; `pipeline.robot.size.scaled` converts them for another one."""
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
