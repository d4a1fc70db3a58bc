"""Signals computed from a trial's sensors: tilt, ground forces, velocity, commanded torques; and a digest of the data.

A log has no base velocity and no contact sensor. Both are estimated: the ground force on each foot from the torques of
its leg, which is assumed massless; the velocity of the trunk from the lowest sole corners, which are assumed at rest.

There is one digest per half second of absolute time. Samples are on a grid that starts in 1970, so that truncated,
split or converted copies of a log have the same digests wherever the data are complete.
"""

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation, time_series
from pipeline.errors import PipelineError
from pipeline.failures.failure import Failure
from pipeline.hardware_logs.regular import LOST
from pipeline.hardware_logs.trial import ROUNDING_S, Trial
from pipeline.physics import GRAVITY
from pipeline.robot import Kinematics, Robot
from pipeline.robot.legs import legs_of

WORK_HZ = 125.0
"""Rate of the kinematics [Hz]; feet and trunk move slowly compared with the log's 500 Hz."""
CUTOFF_HZ = 12.0
"""Cutoff of the zero-phase low pass on differentiated signals [Hz]."""
BLEND_HZ = 0.5
"""Crossover frequency of the trunk's velocity [Hz]: leg kinematics below, accelerometer above."""
DAMPING = 0.006
"""Damping of the least squares for a foot's force [m]; a force that a straight leg cannot sense is estimated as
small."""
LOWEST = 0.006
"""Height above the lowest sole corner at which a corner has a third of its weight in averages [m]."""


class RobotMismatchError(PipelineError):
    """Raised for a trial of another robot."""


@dataclass(frozen=True, kw_only=True)
class Signals:
    """A trial at about `WORK_HZ` with n samples; joint signals of j joints at the trial's own rate."""

    trial: Trial
    robot: Robot
    every: int
    """Number of samples of the trial per sample of these signals."""
    fps: float
    time_s: Float[np.ndarray, " n"]
    known: Bool[np.ndarray, " n"]
    """Samples outside gaps with finite values."""
    tilt_deg: Float[np.ndarray, " n"]
    lean_b: Float[np.ndarray, "n 2"]
    """Horizontal components of gravity in the trunk's frame: lean forward and to the left."""
    command: Float[np.ndarray, "n 3"]
    """Velocity command: forward, left [m/s], yaw rate [rad/s]; 0 where unknown."""
    commanded: Bool[np.ndarray, " n"]
    """Samples with a known command."""
    support: Float[np.ndarray, "n 2"]
    """Vertical ground force on each foot, as a share of the robot's weight."""
    velocity: Float[np.ndarray, "n 2"]
    """Velocity of the trunk in its heading frame, forward and left, from the lowest sole corners [m/s]."""
    yaw_rate: Float[np.ndarray, " n"]
    """Yaw rate of the trunk [rad/s]."""
    sole_speed: Float[np.ndarray, "n 2"]
    """Horizontal speed of the lowest corners of each sole [m/s], with the trunk's velocity from leg kinematics at low
    frequencies and from the accelerometer within a step."""
    sole_height: Float[np.ndarray, "n 2"]
    """Height of each sole's lowest corner over the lower foot's [m]."""
    acceleration_w: Float[np.ndarray, "n 2"]
    """Horizontal acceleration of the trunk in the world frame, from the accelerometer [m/s^2]."""
    specific_force: Float[np.ndarray, " n"]
    """Magnitude of the specific force relative to gravity, mean over 0.25 s: 1 at rest, 0 in free fall."""

    def at(self, time_s: float) -> int:
        """Index of the sample at a time."""
        return int(np.clip(np.searchsorted(self.time_s, time_s), 0, len(self.time_s) - 1))

    def failure(self, kind: str, start_s: float, stop_s: float, *, confidence: float, **more: Any) -> Failure:
        """A failure between two times [s], under the command at the first."""
        forward, lateral, yaw = self.command[self.at(float(start_s))].tolist()
        return Failure(
            kind=kind,
            time_s=float(start_s),
            until_s=float(stop_s),
            command=(forward, lateral, yaw),
            confidence=float(confidence),
            **more,
        )


def signals_of(trial: Trial, robot: Robot) -> Signals:
    """Compute the signals. Raises RobotMismatchError for a trial with other joints."""
    if trial.joint_names != robot.joint_names:
        raise RobotMismatchError(
            f"trial '{trial.name}' is of '{trial.robot}' with {len(trial.joint_names)} joints; robot '{robot.name}' "
            f"has {len(robot.joint_names)} others."
        )
    every = max(round(trial.rate_hz / WORK_HZ), 1)
    fps = trial.rate_hz / every
    arrays = {name: getattr(trial, name) for name in ("joint_pos", "torque_est", "rpy", "gyro_b", "acc_b", "command")}
    finite = trial.measured & np.all([np.isfinite(arrays[name]).all(axis=1) for name in list(arrays)[:5]], axis=0)
    filled = {name: _filled(np.asarray(values, dtype=float), finite) for name, values in arrays.items()}
    filled["rpy"] = np.unwrap(filled["rpy"], axis=0)
    smooth = {name: time_series.smooth(filled[name], trial.rate_hz, CUTOFF_HZ)[::every] for name in list(arrays)[:4]}
    quat = _quat(smooth["rpy"])
    lean = rotation.rotate_inverse(quat, np.array([0.0, 0.0, -1.0]))
    corners, support = _feet(robot, smooth["joint_pos"], quat, smooth["torque_est"])
    corner_velocity = time_series.derivative(corners, fps)[..., :2]
    acceleration = rotation.rotate(_quat(filled["rpy"]), filled["acc_b"])
    width = max(round(0.25 * trial.rate_hz) | 1, 1)
    specific = np.linalg.norm(time_series.moving_mean(acceleration, width), axis=1) / GRAVITY
    velocity_w = -_lowest(corner_velocity, corners[..., 2], axis=(1, 2))
    return Signals(
        trial=trial,
        robot=robot,
        every=every,
        fps=fps,
        time_s=trial.time_s[::every],
        known=finite[::every],
        tilt_deg=np.degrees(np.arccos(np.clip(-lean[:, 2], -1.0, 1.0))),
        lean_b=lean[:, :2],
        command=np.nan_to_num(np.asarray(trial.command, dtype=float)[::every]),
        commanded=np.asarray(np.isfinite(trial.command[::every]).all(axis=1)),
        support=support,
        velocity=_heading(velocity_w, smooth["rpy"][:, 2]),
        yaw_rate=time_series.smooth(time_series.derivative(smooth["rpy"][:, 2], fps), fps, 2.0),
        sole_speed=_sole_speed(corner_velocity, corners[..., 2], velocity_w, acceleration, trial.rate_hz, every),
        sole_height=corners[..., 2].min(axis=2) - corners[..., 2].min(axis=(1, 2))[:, None],
        acceleration_w=time_series.smooth(acceleration, trial.rate_hz, CUTOFF_HZ)[::every, :2],
        specific_force=specific[::every],
    )


def _filled(values: np.ndarray, finite: np.ndarray) -> np.ndarray:
    """Interpolate unknown values (n, k)."""
    good = finite & np.isfinite(values).all(axis=1)
    if good.all() or not good.any():
        return np.nan_to_num(values)
    place = np.arange(len(values))
    return np.column_stack([np.interp(place, place[good], column[good]) for column in values.T])


def _quat(rpy: np.ndarray) -> np.ndarray:
    roll, pitch, yaw = rpy.T
    return rotation.from_euler([(2, yaw), (1, pitch), (0, roll)])


def _feet(
    robot: Robot, joint_pos: np.ndarray, quat: np.ndarray, torque: np.ndarray
) -> tuple[Float[np.ndarray, "n 2 4 3"], Float[np.ndarray, "n 2"]]:
    """Corners of the soles relative to the trunk, world orientation [m], and vertical force on each sole as a share of
    the weight."""
    kinematics = Kinematics(robot)
    poses = kinematics.forward(np.zeros((len(quat), 3)), quat, joint_pos)
    soles = kinematics.site_pos_w(poses, robot.feet)
    tree, support, legs = robot.tree, np.empty((len(quat), 2)), legs_of(robot)
    for side, foot in enumerate(robot.feet):
        chain = tree.chain(int(tree.site_link[robot.site(foot)]))
        links = [link for link in chain if int(tree.joint[link]) in legs.joints[side]]
        axis = rotation.rotate(poses.quat_w[:, links], tree.axis[links])
        arm = soles[:, side, None] - poses.pos_w[:, links]
        rows = np.concatenate([np.cross(axis, arm), axis], axis=2)  # torque of force and moment at the sole
        support[:, side] = _upward(rows, torque[:, tree.joint[links]])
    corners = [kinematics.site_pos_w(poses, sole) for sole in robot.sole_corners]
    return np.stack(corners, axis=1), support / (robot.total_mass * GRAVITY)


def _upward(rows: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Vertical force (n,) from damped least squares of -rows @ (force, moment) = torque."""
    scale = np.array([1.0, 1.0, 1.0, 10.0, 10.0, 10.0])  # prior: a moment of 1 N m is as likely as a force of 10 N
    scaled = rows / scale
    normal = np.einsum("nki,nkj->nij", scaled, scaled) + DAMPING**2 * np.eye(6)
    right = np.einsum("nki,nk->ni", scaled, -torque)
    return np.linalg.solve(normal, right[..., None])[:, 2, 0]


def _lowest(velocity: np.ndarray, height: np.ndarray, axis: tuple[int, ...]) -> np.ndarray:
    """Mean velocity (n, ..., 2) of the lowest corners, weighted by height (n, 2, 4)."""
    share = np.exp(-(height - height.min(axis=axis, keepdims=True)) / LOWEST)
    share /= share.sum(axis=axis, keepdims=True)
    return np.sum(velocity * share[..., None], axis=axis)


def _heading(velocity_w: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Transform horizontal velocities (n, 2) from the world to the heading frame."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    x, y = velocity_w.T
    return np.column_stack([cos * x + sin * y, cos * y - sin * x])


def _sole_speed(
    corner_velocity: np.ndarray,
    height: np.ndarray,
    velocity_w: np.ndarray,
    acceleration_w: np.ndarray,
    rate_hz: float,
    every: int,
) -> Float[np.ndarray, "n 2"]:
    """Horizontal speed of each sole, with the trunk's velocity blended at `BLEND_HZ`."""
    fps = rate_hz / every
    run = np.cumsum(acceleration_w[:, :2], axis=0)[::every] / rate_hz
    fast = run - time_series.smooth(run, fps, BLEND_HZ)
    trunk = time_series.smooth(velocity_w, fps, BLEND_HZ) + time_series.smooth(fast, fps, CUTOFF_HZ)
    return np.linalg.norm(trunk[:, None] + _lowest(corner_velocity, height, axis=(2,)), axis=2)


WINDOW_NS = 500_000_000
DIGITS = 8
"""Hex digits of a window's digest."""
UNKNOWN = "-" * DIGITS
"""Placeholder for an incomplete window: at the trial's ends, and where the log is damaged."""
SENSORS = ("joint_pos", "joint_vel", "torque_est", "rpy", "gyro_b", "acc_b")


def fingerprint_of(trial: Trial) -> str:
    """Concatenated digests of the windows, starting with the one in which the trial begins."""
    period_ns = round(1e9 / trial.rate_hz)
    windows = (trial.start_ns + np.arange(len(trial.time_s)) * period_ns) // WINDOW_NS
    damaged = np.zeros(len(windows), dtype=bool)
    for gap in trial.gaps:
        if gap.reason == LOST:
            damaged |= (trial.time_s > gap.start_s - ROUNDING_S) & (trial.time_s < gap.stop_s + ROUNDING_S)
    starts = np.flatnonzero(np.diff(windows, prepend=windows[0] - 1)).tolist()
    return "".join(
        _digest(trial, start, stop)
        if (stop - start) * period_ns >= WINDOW_NS and not damaged[start:stop].any()
        else UNKNOWN
        for start, stop in zip(starts, [*starts[1:], len(windows)], strict=True)
    )


def windows_of(fingerprint: str, start_ns: int) -> dict[int, str]:
    """Window index since 1970 -> digest, for complete windows."""
    first = start_ns // WINDOW_NS
    parts = [fingerprint[at : at + DIGITS] for at in range(0, len(fingerprint), DIGITS)]
    return {first + number: part for number, part in enumerate(parts) if part != UNKNOWN}


def _digest(trial: Trial, start: int, stop: int) -> str:
    found = hashlib.sha256()
    for name in SENSORS:
        found.update(np.ascontiguousarray(getattr(trial, name)[start:stop], dtype="<f4").tobytes())
    return found.hexdigest()[:DIGITS]
