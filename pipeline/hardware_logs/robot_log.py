"""A log for writing: arrays of each topic with receipt times, and the log's metadata."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int

COMMAND_SOURCES = ("schedule", "remote", "unknown")
"""Source of the velocity command: schedule in metadata or sidecar, the remote's sticks, or unknown."""

EVENTS = ("held", "released", "stop", "pushed")
"""Events that an operator notes; `button <name>` comes from the remote."""

METADATA = "booster_lab"
"""Name of the MCAP metadata record; the sidecar has the same keys."""


@dataclass(frozen=True, kw_only=True)
class OperatorEvent:
    """An action of a person."""

    time_s: float
    """Time since the log's first message [s]."""
    kind: str
    """One of `EVENTS`, or `button <name>` for a button that was pressed on the remote."""
    source: str = "metadata"
    """`metadata`, `sidecar` or `remote`."""


@dataclass(frozen=True, kw_only=True)
class LogFacts:
    """Metadata of a log that are not in the robot's messages."""

    robot: str
    policy_digest: str | None = None
    """SHA-256 of the policy that ran; None if not recorded."""
    command_source: str = "unknown"
    simulated: bool = False
    command: tuple[tuple[float, float, float, float], ...] = ()
    """Schedule rows: start time [s], forward and left velocity [m/s], yaw rate [rad/s]."""
    command_scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Velocity at full stick deflection [m/s, m/s, rad/s], for the source `remote`."""
    events: tuple[OperatorEvent, ...] = ()
    notes: dict[str, str] = field(default_factory=dict)
    """Further metadata, copied unchanged."""


@dataclass(frozen=True, kw_only=True)
class LowStates:
    """`/low_state`: n messages of j joints, serial arrays (the joints of the model)."""

    time_ns: Int[np.ndarray, " n"]
    """Receipt times since 1970, non-decreasing [ns]."""
    rpy: Float[np.ndarray, "n 3"]
    """Trunk in the world, R = Rz(yaw) Ry(pitch) Rx(roll) [rad]."""
    gyro_b: Float[np.ndarray, "n 3"]
    """[rad/s]"""
    acc_b: Float[np.ndarray, "n 3"]
    """Specific force [m/s^2], +9.8 on z when the trunk is upright and at rest."""
    joint_pos: Float[np.ndarray, "n j"]
    """[rad]"""
    joint_vel: Float[np.ndarray, "n j"]
    """[rad/s]"""
    joint_acc: Float[np.ndarray, "n j"]
    """[rad/s^2]"""
    torque_est: Float[np.ndarray, "n j"]
    """[N m]"""
    temperature_c: Int[np.ndarray, "n j"]
    """Motor temperatures, -128 to 127 [deg C]."""
    lost: Int[np.ndarray, "n j"]
    """Packets lost since the motors started."""


@dataclass(frozen=True, kw_only=True)
class LowCmds:
    """`/joint_ctrl`: m messages in the serial convention."""

    time_ns: Int[np.ndarray, " m"]
    target_pos: Float[np.ndarray, "m j"]
    """[rad]"""
    target_torque: Float[np.ndarray, "m j"]
    """Feed-forward [N m]."""
    kp: Float[np.ndarray, "m j"]
    """[N m/rad]"""
    kd: Float[np.ndarray, "m j"]
    """[N m s/rad]"""


@dataclass(frozen=True, kw_only=True)
class FallStates:
    """`/fall_down`: 0 ready, 1 falling, 2 has fallen, 3 getting up."""

    time_ns: Int[np.ndarray, " m"]
    state: Int[np.ndarray, " m"]
    recovery_available: Int[np.ndarray, " m"]
    """Whether the robot can get up: 0 or 1."""


@dataclass(frozen=True, kw_only=True)
class Odometry:
    """`/odometer_state`: planar pose, with the bias of the robot's estimator."""

    time_ns: Int[np.ndarray, " m"]
    pose: Float[np.ndarray, "m 3"]
    """x, y [m], theta [rad]."""


@dataclass(frozen=True, kw_only=True)
class RobotLog:
    """A complete log; topics that were not recorded are None."""

    facts: LogFacts
    low_state: LowStates
    joint_ctrl: LowCmds | None = None
    fall_down: FallStates | None = None
    odometer: Odometry | None = None
    further: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    """Times of receipt and payloads of further topics."""
