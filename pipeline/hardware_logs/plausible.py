"""Check the plausibility of a log's values, which checksums cannot show (and unchunked files have none).

Sensors are checked, too: constant values, attitude in degrees, acceleration in g or reversed. Findings about sensors do
not reject a log; each is a sentence in the log's notes.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int64

from pipeline.hardware_logs.columns import LINEAR, Columns
from pipeline.hardware_logs.log_report import PlausibleSettings
from pipeline.physics import GRAVITY
from pipeline.robot import Robot

LEAST_REST = 50
"""Least number of messages at rest for the check of gravity, since joints are also slow while they reverse."""


@dataclass
class Plausible:
    """Plausibility check of the `/low_state` messages of one log, block by block."""

    settings: PlausibleSettings
    robot: Robot
    messages: int = 0
    not_finite: int = 0
    out_of_range: int = 0
    restarts: int = 0
    """Number of decreases of a motor's lost packet counter."""
    rest: int = 0
    """Number of messages at rest."""
    worst_joints: dict[str, int] = field(default_factory=dict)
    """Joint -> number of messages out of range."""
    _rest_force: float = 0.0
    _rest_tilt: float = 0.0
    _lost: np.ndarray | None = None

    def finite(self, columns: Columns) -> Bool[np.ndarray, " m"]:
        """Process a block; return the mask of messages with only finite values."""
        finite = np.ones(len(columns["lost"]), dtype=bool)
        for name in LINEAR:
            finite &= np.isfinite(columns[name].sum(axis=1, dtype=np.float64))
        self.messages += len(finite)
        self.not_finite += int((~finite).sum())
        return finite

    def in_range(self, columns: Columns) -> Bool[np.ndarray, " m"]:
        """Process a block of finite messages; return the mask of messages within range."""
        values, limits = columns["joint_pos"], self.settings
        margin = limits.position_margin_rad
        wrong = (values < self.robot.joint_lower - margin) | (values > self.robot.joint_upper + margin)
        wrong |= np.abs(columns["joint_vel"]) > limits.speed_factor * self.robot.motor_speed_limit
        for joint in np.flatnonzero(wrong.any(axis=0)).tolist():
            name = self.robot.joint_names[joint]
            self.worst_joints[name] = self.worst_joints.get(name, 0) + int(wrong[:, joint].sum())
        bad = wrong.any(axis=1) | (np.abs(columns["acc_b"]).max(axis=1, initial=0.0) > limits.acceleration_m_s2)
        self.out_of_range += int(bad.sum())
        self._note_rest(columns, ~bad)
        self._note_lost(columns["lost"])
        return ~bad

    def _note_rest(self, columns: Columns, good: np.ndarray) -> None:
        limits = self.settings
        still = good & (np.abs(columns["gyro_b"]).max(axis=1, initial=0.0) < limits.rest_gyro_rad_s)
        still &= np.abs(columns["joint_vel"]).max(axis=1, initial=0.0) < limits.rest_joint_rad_s
        if not still.any():
            return
        force = columns["acc_b"][still].astype(np.float64)
        length = np.linalg.norm(force, axis=1)
        along = np.sum(force * upward(columns["rpy"][still]), axis=1) / np.maximum(length, 1e-9)
        self.rest += int(still.sum())
        self._rest_force += float(length.sum())
        self._rest_tilt += float(np.degrees(np.arccos(np.clip(along, -1.0, 1.0))).sum())

    def _note_lost(self, lost: np.ndarray) -> None:
        before = lost[:1] if self._lost is None else self._lost
        if len(lost):
            self.restarts += int((np.diff(lost, axis=0, prepend=before) < 0).any(axis=1).sum())
            self._lost = lost[-1:]

    def refusal(self) -> str:
        """Why the log is rejected; empty if it is not."""
        odd = self.not_finite + self.out_of_range
        if odd > self.settings.implausible_share * max(self.messages, 1):
            worst = max(self.worst_joints, key=lambda name: self.worst_joints[name], default="the trunk")
            return (
                f"{odd} of {self.messages} messages are not finite or beyond what '{self.robot.name}' can do, most "
                f"of {worst}: is it of another robot or unit"
            )
        low, high = self.settings.rest_gravity_m_s2
        if self.rest >= LEAST_REST and not low <= self._rest_force / self.rest <= high:
            return f"at rest the specific force is {self._rest_force / self.rest:.2f} m/s^2: is it of another unit"
        return ""

    def remarks(self) -> list[str]:
        """Irregularities that do not reject the log."""
        notes = []
        if self.not_finite:
            notes.append(f"{self.not_finite} messages with numbers that are not finite are left out.")
        if self.out_of_range:
            joints = ", ".join(f"{name} {count}" for name, count in sorted(self.worst_joints.items()))
            notes.append(f"{self.out_of_range} messages are out of range ({joints or 'acceleration'}).")
        if self.restarts:
            notes.append(f"the count of lost packets fell {self.restarts} times.")
        if self.rest >= LEAST_REST and self._rest_tilt / self.rest > self.settings.rest_tilt_deg:
            tilt = self._rest_tilt / self.rest
            notes.append(
                f"at rest gravity is {tilt:.0f} degrees off the attitude: accelerometer and attitude disagree."
            )
        return notes


IN_G = (0.5, 2.0)
"""Mean length of the specific force of a robot on the ground, in g; in m/s^2 it is about 10."""
REVERSED = -0.5
"""Mean share of the specific force along the attitude's upward axis below which one of both is reversed."""
WINDOW_S = 0.1
"""Window for the comparison of rotations from attitude and gyroscope [s]."""
LEAST_TURN = 0.02
"""Least mean rotation of the attitude in a window for that comparison, to exclude noise [rad, or the file's unit]."""
DEGREES_FROM = 10.0
"""Ratio of the rotations from attitude and gyroscope above which the attitude is in degrees (then about 57)."""


IMU = {"rpy": "the attitude", "gyro_b": "the gyroscope", "acc_b": "the accelerometer"}
"""Columns of the IMU, whose noise prevents constant values. A joint's position and velocity are checked together,
because the encoders of a standing robot may be constant for seconds."""


@dataclass
class SensorWatch:
    """Sensor check of the finite `/low_state` messages of one log, block by block."""

    robot: Robot
    frozen_s: float
    """Shortest time of a constant value that is reported [s]."""
    messages: int = 0
    _length: float = 0.0
    _upward: float = 0.0
    _runs: "_Runs | None" = None
    _turns: "_Turns" = field(default_factory=lambda: _Turns())

    def add(self, time_ns: Int64[np.ndarray, " m"], columns: Columns) -> None:
        """Process messages in the order of receipt."""
        if not len(time_ns):
            return
        force = columns["acc_b"].astype(np.float64)
        length = np.linalg.norm(force, axis=1)
        self.messages += len(length)
        self._length += float(length.sum())
        self._upward += float((np.sum(force * upward(columns["rpy"]), axis=1) / np.maximum(length, 1e-9)).sum())
        imu = np.stack([columns[name] for name in IMU], axis=1)
        pos, vel = columns["joint_pos"], columns["joint_vel"]
        signals = np.concatenate([imu, np.stack([pos, vel, np.zeros_like(pos)], axis=2)], axis=1)
        if self._runs is None:
            self._runs = _Runs(signals.shape[1])
        self._runs.add(time_ns, signals)
        self._turns.add(time_ns, columns["rpy"].astype(np.float64), columns["gyro_b"].astype(np.float64))

    def remarks(self) -> list[str]:
        """Findings, one sentence each."""
        if self._runs is None:
            return []
        frozen_s = self._runs.longest_ns / 1e9
        notes = []
        names = (*IMU.values(), *self.robot.joint_names)
        frozen = {name: each for name, each in zip(names, frozen_s.tolist(), strict=True) if each >= self.frozen_s}
        of_imu = {name: each for name, each in frozen.items() if name in IMU.values()}
        if len(of_imu) == len(IMU):
            notes.append(f"the IMU is frozen: none of its values changed for {min(of_imu.values()):.1f} s.")
        elif of_imu:
            which = " and ".join(of_imu)
            notes.append(f"the IMU is frozen in part: {which} did not change for up to {max(of_imu.values()):.1f} s.")
        still = {name: each for name, each in frozen.items() if name not in IMU.values()}
        if still:
            which = "all joints" if len(still) == len(self.robot.joint_names) else ", ".join(still)
            notes.append(f"joint sensors are frozen: {which} did not change for up to {max(still.values()):.1f} s.")
        length, along = self._length / self.messages, self._upward / self.messages
        if IN_G[0] < length < IN_G[1]:
            notes.append(f"the acceleration is in g: its mean length is {length:.2f}, not {GRAVITY} m/s^2.")
        if along < REVERSED:
            notes.append("the acceleration has the wrong sign: on average it points down along the attitude.")
        turns = self._turns
        if turns.windows and turns.attitude > LEAST_TURN * turns.windows and turns.ratio() > DEGREES_FROM:
            notes.append(f"the attitude is in degrees: it turns {turns.ratio():.0f} times as fast as the gyroscope.")
        return notes


def upward(rpy: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "m 3"]:
    """The world's z axis in the body frame, from roll, pitch and yaw [rad]."""
    roll, pitch = rpy[:, 0].astype(np.float64), rpy[:, 1].astype(np.float64)
    return np.stack([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)], axis=1)


class _Runs:
    """Longest time of a constant value of each signal, across blocks."""

    def __init__(self, signals: int):
        self.longest_ns = np.zeros(signals, dtype=np.int64)
        self._since: np.ndarray | None = None
        self._last: tuple[int, np.ndarray] | None = None

    def add(self, time_ns: np.ndarray, signals: np.ndarray) -> None:
        """Process signals (m, s, 3) of messages at times (m,)."""
        if self._last is None or self._since is None:
            self._since = np.full(len(self.longest_ns), time_ns[0], dtype=np.int64)
            self._last = (int(time_ns[0]), signals[0])
        times = np.concatenate([[self._last[0]], time_ns])  # including the last message of the previous block
        changed = (np.diff(signals, axis=0, prepend=self._last[1][None]) != 0.0).any(axis=2)
        for signal in range(len(self.longest_ns)):
            at = np.flatnonzero(changed[:, signal])
            starts = np.concatenate([[self._since[signal]], times[at + 1]])
            ends = np.concatenate([times[at], [times[-1]]])
            self.longest_ns[signal] = max(self.longest_ns[signal], int((ends - starts).max()))
            self._since[signal] = starts[-1]
        self._last = (int(time_ns[-1]), signals[-1])


class _Turns:
    """Rotation of roll and pitch over windows, from the attitude and from the gyroscope."""

    def __init__(self):
        self.attitude, self.gyro, self.windows = 0.0, 0.0, 0
        self._open: tuple[int, np.ndarray, np.ndarray] | None = None
        self._last_ns = 0

    def add(self, time_ns: np.ndarray, rpy: np.ndarray, gyro: np.ndarray) -> None:
        if self._open is None:
            self._open, self._last_ns = (int(time_ns[0]), rpy[0, :2], np.zeros(2)), int(time_ns[0])
        steps = np.clip(np.diff(time_ns, prepend=self._last_ns), 0, 20_000_000)[:, None] * 1e-9
        turned = np.cumsum(gyro[:, :2] * steps, axis=0)
        start = 0
        while True:
            begun_ns, attitude, carried = self._open
            later = np.flatnonzero(time_ns[start:] - begun_ns >= WINDOW_S * 1e9)
            before = turned[start - 1] if start else np.zeros(2)
            if not len(later):
                self._open = (begun_ns, attitude, carried + turned[-1] - before)
                break
            stop = start + int(later[0])
            self.attitude += float(np.abs(rpy[stop, :2] - attitude).sum())
            self.gyro += float(np.abs(carried + turned[stop] - before).sum())
            self.windows += 1
            self._open, start = (int(time_ns[stop]), rpy[stop, :2], np.zeros(2)), stop + 1
            if start >= len(time_ns):
                break
        self._last_ns = int(time_ns[-1])

    def ratio(self) -> float:
        return self.attitude / max(self.gyro, 1e-9)
