"""Convert a rollout to the log that the robot's recorder would have written, marked as simulated."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pipeline import rotation, time_series
from pipeline.hardware_logs.robot_log import FallStates, LogFacts, LowCmds, LowStates, Odometry, RobotLog
from pipeline.physics import GRAVITY
from pipeline.simulation.record import Rollout


@dataclass(frozen=True, kw_only=True)
class LogQuality:
    """Standard deviations of normal noise (in m, rad, s and N m), and losses. Estimates: no T1 log is published."""

    attitude: float = 0.003
    gyro: float = 0.01
    acceleration: float = 0.15
    joint_pos: float = 0.0005
    joint_vel: float = 0.03
    torque_share: float = 0.02
    """Relative torque noise: motor current is measured, gear losses are not."""
    torque: float = 0.3
    odometer_scale: float = 1.0 / 1.2
    """Ratio of odometer to true distance: Booster's demo rescales the T1's odometer by 1.2."""
    odometer_drift: float = 0.005
    """Random walk of each speed over one second [m/s, rad/s]."""
    jitter_s: float = 0.0002
    """Jitter of the time of receipt [s]."""
    message_loss: float = 0.001
    """Share of lost messages."""
    motor_loss_hz: float = 0.02
    """Lost packets per motor and second."""


SOUND = LogQuality()


@dataclass(frozen=True, kw_only=True)
class HeatModel:
    """Motor temperature: heating by the square of the torque, cooling towards the ambient temperature."""

    ambient_c: float = 25.0
    start_c: float = 38.0
    rise_k: float = 150.0
    """Steady-state rise above ambient at the torque limit [K]; at a third of the torque, the motor reaches 42 degC."""
    time_constant_s: float = 180.0
    heating: float = 1.0
    """Factor on the heating, for a faulty motor."""


EPOCH_NS = 1_767_225_600_000_000_000
"""2026-01-01, fixed so that equal rollouts give equal bytes."""
GRAVITY_W = np.array([0.0, 0.0, -GRAVITY])
FALL_HZ, ODOMETER_HZ = 10.0, 50.0
FALLING_DEG, FALLEN_DEG = 45.0, 60.0
"""Tilts at which the robot reports falling and fallen."""
FALLEN_S = 0.6
"""Minimum time from reported falling to reported fallen [s]."""


def record(
    rollout: Rollout,
    kp: Float[np.ndarray, " j"],
    kd: Float[np.ndarray, " j"],
    facts: LogFacts,
    rng: np.random.Generator,
    *,
    quality: LogQuality = SOUND,
    heat: Mapping[str, HeatModel] | None = None,
    every: int = 1,
) -> RobotLog:
    """Make the log of a rollout.

    Args:
        rollout: simulated walk
        kp: joint stiffness that was commanded [N m/rad]
        kd: joint damping that was commanded [N m s/rad]
        facts: facts of the log; the walking command is added with the source `schedule`
        rng: draws noise and losses
        quality: imperfections of sensors and network
        heat: motors with other heating, by joint
        every: log every n-th timestep
    """
    schedule = _schedule(rollout)
    facts = dataclasses.replace(facts, simulated=True, command=schedule, command_source="schedule")
    times = _times(len(rollout.qpos), rollout.timestep_s)
    states = _low_states(rollout, times, rng, quality, heat or {})
    kept = (rng.random(len(times)) >= quality.message_loss) & (np.arange(len(times)) % every == 0)
    kept[0] = True
    return RobotLog(
        facts=facts,
        low_state=_some(states, kept, rng, quality),
        joint_ctrl=_commands(rollout, kp, kd),
        fall_down=_falls(rollout),
        odometer=_odometry(rollout, rng, quality),
    )


def _times(count: int, step_s: float) -> Int[np.ndarray, " n"]:
    return EPOCH_NS + np.rint(np.arange(count) * step_s * 1e9).astype(np.int64)


def _schedule(rollout: Rollout) -> tuple[tuple[float, float, float, float], ...]:
    """Time and value of each change of the command."""
    command, step_s = rollout.command, rollout.control_steps * rollout.timestep_s
    changed = np.concatenate([[True], np.any(command[1:] != command[:-1], axis=1)])
    rows = [(tick * step_s, *command[tick].tolist()) for tick in np.flatnonzero(changed)]
    return tuple((round(row[0], 6), row[1], row[2], row[3]) for row in rows)


def _low_states(
    rollout: Rollout,
    times: Int[np.ndarray, " n"],
    rng: np.random.Generator,
    quality: LogQuality,
    heat: Mapping[str, HeatModel],
) -> LowStates:
    fps = 1.0 / rollout.timestep_s
    quat, qvel = rollout.qpos[:, 3:7], rollout.qvel
    qacc = rollout.qacc if rollout.qacc is not None else time_series.derivative(qvel, fps)
    specific = rotation.rotate_inverse(quat, qacc[:, :3] - GRAVITY_W)

    def noisy(values: np.ndarray, width: float) -> np.ndarray:
        return values + rng.normal(0.0, width, values.shape)

    torque = rollout.torque * (1.0 + rng.normal(0.0, quality.torque_share, rollout.torque.shape))
    lost = rng.poisson(quality.motor_loss_hz * rollout.timestep_s, rollout.torque.shape)
    rpy = noisy(roll_pitch_yaw(quat), quality.attitude)
    return LowStates(
        time_ns=times,
        rpy=np.stack([rpy[:, 0], rpy[:, 1], rotation.wrap(rpy[:, 2])], axis=1),
        gyro_b=noisy(qvel[:, 3:6], quality.gyro),
        acc_b=noisy(specific, quality.acceleration),
        joint_pos=noisy(rollout.qpos[:, 7:], quality.joint_pos),
        joint_vel=noisy(qvel[:, 6:], quality.joint_vel),
        joint_acc=qacc[:, 6:].copy(),
        torque_est=noisy(torque, quality.torque),
        temperature_c=np.clip(np.rint(temperatures(rollout, heat)), -128, 127).astype(int),
        lost=np.cumsum(lost, axis=0),
    )


def roll_pitch_yaw(quat: Float[np.ndarray, "n 4"]) -> Float[np.ndarray, "n 3"]:
    """Angles of R = Rz(yaw) Ry(pitch) Rx(roll) [rad]."""
    w, x, y, z = quat.T
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.stack([roll, pitch, yaw], axis=1)


def temperatures(rollout: Rollout, heat: Mapping[str, HeatModel]) -> Float[np.ndarray, "n j"]:
    """Temperature of each motor over time [degC]."""
    robot = rollout.robot
    models = [heat.get(name, HeatModel()) for name in robot.joint_names]
    load = (rollout.torque / robot.torque_limit) ** 2
    found = np.empty_like(load)
    now = np.array([each.start_c for each in models])
    ambient = np.array([each.ambient_c for each in models])
    rise = np.array([each.rise_k * each.heating for each in models])
    share = rollout.timestep_s / np.array([each.time_constant_s for each in models])
    for step, part in enumerate(load):
        found[step] = now
        now = now + share * (ambient + rise * part - now)
    return found


def _some(states: LowStates, kept: np.ndarray, rng: np.random.Generator, quality: LogQuality) -> LowStates:
    """The received messages, with jitter."""
    arrays = {name: value[kept] for name, value in vars(states).items() if isinstance(value, np.ndarray)}
    late = np.rint(np.abs(rng.normal(0.0, quality.jitter_s, int(kept.sum()))) * 1e9).astype(np.int64)
    late[0] = 0
    return dataclasses.replace(states, **{**arrays, "time_ns": np.maximum.accumulate(arrays["time_ns"] + late)})


def _commands(rollout: Rollout, kp: np.ndarray, kd: np.ndarray) -> LowCmds:
    """One command per control step, as booster_deploy sends them."""
    count = len(rollout.target)
    return LowCmds(
        time_ns=_times(count, rollout.control_steps * rollout.timestep_s),
        target_pos=rollout.target.copy(),
        target_torque=np.zeros_like(rollout.target),
        kp=np.tile(kp, (count, 1)),
        kd=np.tile(kd, (count, 1)),
    )


def _falls(rollout: Rollout) -> FallStates:
    """The reported fall state: ready, falling, fallen."""
    step = max(round(1.0 / (FALL_HZ * rollout.timestep_s)), 1)
    quat = rollout.qpos[:, 3:7]
    tilt = np.degrees(np.arccos(np.clip(1.0 - 2.0 * (quat[:, 1] ** 2 + quat[:, 2] ** 2), -1.0, 1.0)))
    tipped = np.flatnonzero(tilt > FALLING_DEG)
    state = np.zeros(len(tilt), dtype=int)
    if len(tipped):
        state[tipped[0] :] = 1
        state[(np.arange(len(tilt)) > tipped[0] + FALLEN_S / rollout.timestep_s) & (tilt > FALLEN_DEG)] = 2
    reported = state[::step]
    return FallStates(
        time_ns=_times(len(reported), step * rollout.timestep_s),
        state=reported,
        recovery_available=(reported == 2).astype(int),
    )


def _odometry(rollout: Rollout, rng: np.random.Generator, quality: LogQuality) -> Odometry:
    """Odometry relative to the start, with wrong scale and drift."""
    step = max(round(1.0 / (ODOMETER_HZ * rollout.timestep_s)), 1)
    place = rollout.qpos[::step, :2] - rollout.qpos[0, :2]
    yaw = np.unwrap(rotation.yaw_of(rollout.qpos[::step, 3:7]))
    period_s = step * rollout.timestep_s
    drift = np.cumsum(rng.normal(0.0, quality.odometer_drift * np.sqrt(period_s), (len(place), 3)), axis=0)
    pose = np.column_stack([quality.odometer_scale * place, yaw]) + np.cumsum(drift, axis=0) * period_s
    return Odometry(time_ns=_times(len(place), period_s), pose=pose)
