"""Each trial against MuJoCo with the same policy, gains and command: how it tracks, and the cycle of its legs.

The twin is the robot as it is calibrated, so what differs is what the calibration does not know.
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
"""Of a twin's walk [s]."""
SIDES = ("Left", "Right")
WALKS_M_S = 0.3
"""Slower commands have no cycle to compare [m/s]."""


@dataclass(frozen=True, kw_only=True)
class Twin:
    """A steady stretch of a trial beside its simulation."""

    command: tuple[float, float, float]
    start_s: float
    stop_s: float
    achieved: tuple[float, float, float]
    """By the trial: forward, lateral [m/s], yaw rate [rad/s]."""
    simulated: tuple[float, float, float]
    """By its twin."""
    simulation_fell: bool
    cycles: tuple[Comparison, ...]
    """The trial's leg joints compared with the simulation's."""
    notes: tuple[str, ...]


def twin_of(
    trial: Trial,
    robot: Robot,
    actuators: Sequence[JointActuator],
    policy: Policy,
    settings: FailureSettings,
    until_s: float,
) -> Twin | None:
    """The longest steady stretch of a trial before `until_s` beside its simulation; None where nothing is steady."""
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
    if not rollout.fell and float(np.hypot(forward, lateral)) >= WALKS_M_S:
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
    """The walk of a trial in MuJoCo: its commands and the gains that it sent, the calibrated motors, ideal sensors."""
    gains = {name: _sent(getattr(trial, name), getattr(robot, name)) for name in ("kp", "kd")}
    task = dataclasses.replace(policy_task(robot, policy), **gains)
    one = Deployed(robot=robot, task=task, policy=policy, envelope=torque_envelope(actuators))
    command = np.nan_to_num(np.asarray(trial.command, dtype=float))

    def wanted(time_s: float) -> np.ndarray:
        return command[min(round(time_s * trial.rate_hz), len(command) - 1)]

    plant = MujocoPlant(robot, MujocoOptions(timestep_s=TIMESTEP_S))
    return one.walk(plant, wanted, seconds, wrench_every=10_000, stop_on_fall=True)


def _sent(gains: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """The gains of most of a trial; the robot's where none were sent."""
    gains = np.asarray(gains, dtype=float)
    known = gains[np.isfinite(gains).all(axis=1)]
    return np.median(known, axis=0) if len(known) else np.array(otherwise)


def velocity_of(rollout: Rollout, start_s: float, stop_s: float) -> tuple[float, float, float]:
    """Mean velocity in the heading frame and yaw rate over a stretch, or as far as the walk went."""
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
    """The samples of some arrays between two times [s]."""
    return [array[round(start_s * rate_hz) : round(stop_s * rate_hz)] for array in arrays]


def cycle_failures(twin: Twin, settings: FailureSettings) -> list[Failure]:
    """Legs whose cycle is not that of the simulation."""
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
    """The report with what the comparison with the simulation adds."""
    if twin is None:
        return report
    found = sorted((*report.failures, *cycle_failures(twin, settings)), key=lambda each: (each.time_s, each.kind))
    return dataclasses.replace(report, failures=tuple(found))
