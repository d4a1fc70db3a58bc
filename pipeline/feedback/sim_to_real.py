"""Comparison of each hardware trial with MuJoCo under the same policy, gains and commands.

Compares the achieved velocities and the limit cycles of the legs. The simulation (the twin) uses the calibrated robot,
so the differences are effects that the calibration does not model.
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.actuators.adapted_robot import JointActuator, torque_envelope
from pipeline.deployment import Policy, policy_task
from pipeline.failures.failure import Failure
from pipeline.failures.settings import FailureSettings
from pipeline.failures.signals import signals_of
from pipeline.failures.tracking import steady_stretches
from pipeline.failures.trial_report import TrialReport
from pipeline.hardware_logs.trial import Trial
from pipeline.quality.planar_motion import command_velocity
from pipeline.robot import Robot
from pipeline.robot.legs import legs_of
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.simulation.record import Rollout
from pipeline.validation.deployed import Deployed
from pipeline.validation.limit_cycles import PLANES, Comparison, NoCycleError, compare, leg_series, limit_cycle

TIMESTEP_S = 0.002
LONGEST_S = 14.0
"""Longest duration of a twin's walk [s]."""
SIDES = ("Left", "Right")
SLOWEST_WALK_M_S = 0.3
"""Limit cycles are compared from this commanded speed on [m/s]."""


@dataclass(frozen=True, kw_only=True)
class Twin:
    """A steady stretch of a trial, and its simulation."""

    command: tuple[float, float, float]
    start_s: float
    stop_s: float
    achieved: tuple[float, float, float]
    """Mean velocity in the trial, heading frame: forward, lateral [m/s], yaw rate [rad/s]."""
    simulated: tuple[float, float, float]
    """Mean velocity in the simulation, as `achieved`."""
    simulation_fell: bool
    cycles: tuple[Comparison, ...]
    """Limit cycle of each leg in the trial, compared with the simulation."""
    notes: tuple[str, ...]


def twin_of(
    trial: Trial,
    robot: Robot,
    actuators: Sequence[JointActuator],
    policy: Policy,
    settings: FailureSettings,
    until_s: float,
) -> Twin | None:
    """Compare the longest steady stretch of a trial with its simulation; None without a steady stretch.

    Args:
        trial: the trial
        robot: nominal robot
        actuators: calibrated actuators
        policy: policy of the trial
        settings: thresholds for steadiness
        until_s: end of the usable part of the trial, for example a fall [s]
    """
    signals = signals_of(trial, robot)
    stretches = steady_stretches(signals, settings.tracking, min(until_s, LONGEST_S))
    if not stretches:
        return None
    start, stop = max(stretches, key=lambda pair: pair[1] - pair[0])
    rollout = simulated(trial, robot, actuators, policy, float(signals.time_s[stop - 1]))
    forward, lateral, yaw = signals.command[start].tolist()
    start_s, stop_s = float(signals.time_s[start]), float(signals.time_s[stop - 1])
    achieved = signals.velocity[start:stop].mean(axis=0).tolist()
    notes: list[str] = []
    cycles: tuple[Comparison, ...] = ()
    if not rollout.fell and float(np.hypot(forward, lateral)) >= SLOWEST_WALK_M_S:
        cycles = _cycles(trial, rollout, start_s, stop_s, notes)
    return Twin(
        command=(forward, lateral, yaw),
        start_s=start_s,
        stop_s=stop_s,
        achieved=(*achieved, float(signals.yaw_rate[start:stop].mean())),
        simulated=velocity_of(rollout, start_s, stop_s),
        simulation_fell=rollout.fell,
        cycles=cycles,
        notes=tuple(notes),
    )


def simulated(
    trial: Trial, robot: Robot, actuators: Sequence[JointActuator], policy: Policy, seconds: float
) -> Rollout:
    """Repeat a trial in MuJoCo with its logged commands and gains, calibrated motors and ideal sensors.

    Args:
        trial: the trial
        robot: nominal robot
        actuators: calibrated actuators
        policy: policy of the trial
        seconds: duration [s]
    """
    gains = {name: _logged_gains(getattr(trial, name), getattr(robot, name)) for name in ("kp", "kd")}
    task = dataclasses.replace(policy_task(robot, policy), **gains)
    deployed = Deployed(robot=robot, task=task, policy=policy, envelope=torque_envelope(actuators))
    command = np.nan_to_num(np.asarray(trial.command, dtype=float))

    def command_at(time_s: float) -> np.ndarray:
        return command[min(round(time_s * trial.rate_hz), len(command) - 1)]

    plant = MujocoPlant(robot, MujocoOptions(timestep_s=TIMESTEP_S))
    return deployed.walk(plant, command_at, seconds, wrench_every=10_000, stop_on_fall=True)


def _logged_gains(gains: np.ndarray, default: np.ndarray) -> np.ndarray:
    """Median of the logged gains (n, joints); `default` (joints,) if none were logged."""
    gains = np.asarray(gains, dtype=float)
    known = gains[np.isfinite(gains).all(axis=1)]
    return np.median(known, axis=0) if len(known) else np.array(default)


def velocity_of(rollout: Rollout, start_s: float, stop_s: float) -> tuple[float, float, float]:
    """Mean forward and lateral velocity [m/s] in the heading frame and yaw rate [rad/s] over a stretch, or until the
    walk ended."""
    rate = 1.0 / rollout.timestep_s
    kept = slice(min(round(start_s * rate), len(rollout.qpos) - 2), round(stop_s * rate))
    found = command_velocity(rollout.qpos[kept, :3], rollout.qpos[kept, 3:7], rate)
    return found.forward_m_s, found.lateral_m_s, found.yaw_rate_rad_s


def _cycles(trial: Trial, rollout: Rollout, start_s: float, stop_s: float, notes: list[str]) -> tuple[Comparison, ...]:
    found, legs = [], legs_of(rollout.robot)
    simulated = (1.0 / rollout.timestep_s, rollout.qpos[:, 7:], rollout.qvel[:, 6:])
    logged = (trial.rate_hz, trial.joint_pos, trial.joint_vel)
    for side, hip, knee in zip(SIDES, legs.hip_pitch, legs.knee, strict=True):
        try:
            reference, own = (
                limit_cycle(leg_series(f"{name} {side}", hip, knee, rate, *_between(rate, start_s, stop_s, *motion)))
                for name, (rate, *motion) in (("MuJoCo", simulated), (trial.name, logged))
            )
            found.append(compare(reference, own))
        except NoCycleError as error:
            notes.append(str(error))
    return tuple(found)


def _between(rate_hz: float, start_s: float, stop_s: float, *arrays: np.ndarray) -> list[np.ndarray]:
    """The samples of the arrays between two times."""
    return [array[round(start_s * rate_hz) : round(stop_s * rate_hz)] for array in arrays]


def cycle_failures(twin: Twin, settings: FailureSettings) -> list[Failure]:
    """A failure if the limit cycle of a leg deviates from the simulation; else empty."""
    bound = settings.limit_cycle.deviation
    worst = max(twin.cycles, key=lambda each: each.shape_distance[PLANES[0]], default=None)
    if worst is None or worst.shape_distance[PLANES[0]] <= bound:
        return []
    distance = worst.shape_distance[PLANES[0]]
    return [
        Failure(
            kind="limit_cycle",
            time_s=twin.start_s,
            until_s=twin.stop_s,
            command=twin.command,
            confidence=float(min(0.7 + 0.5 * (distance / bound - 1.0), 0.95)),
            evidence={
                "shape distance of hip against knee": distance,
                "period over the simulation's": worst.period_ratio,
                "knee amplitude over the simulation's": worst.knee_amplitude_ratio,
            },
        )
    ]


def with_cycle_failures(report: TrialReport, twin: Twin | None, settings: FailureSettings) -> TrialReport:
    """Add the limit cycle failures of the twin to the report of a trial."""
    if twin is None:
        return report
    found = sorted((*report.failures, *cycle_failures(twin, settings)), key=lambda each: (each.time_s, each.kind))
    return dataclasses.replace(report, failures=tuple(found))
