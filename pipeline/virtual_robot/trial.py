"""One trial of a virtual robot: controller, command and deviations in, rollout and log out."""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from pipeline.deployment.controller import Reading
from pipeline.hardware_logs.robot_log import LogFacts, OperatorEvent, RobotLog
from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.simulation.plant import Push
from pipeline.simulation.record import Rollout
from pipeline.simulation.run import FALL_TILT_COS, Controller, run
from pipeline.simulation.sensors import NoisySensors, SensorNoise
from pipeline.simulation.torque_envelope import PdControl
from pipeline.virtual_robot.deviations import (
    Deviations,
    FailingMotors,
    Outage,
    by_joint,
    envelope_of,
    joints_of,
    motor_envelope,
)
from pipeline.virtual_robot.record import SOUND, HeatModel, record
from pipeline.virtual_robot.scripted import HeldPlant, Hold


class FallGuard:
    """Forwards another controller until the trunk tilts by 60 degrees, at which booster_deploy stops its policy; then
    commands the current joint positions."""

    def __init__(self, inner: Controller):
        self.inner, self.task = inner, inner.task
        self.reset()

    def reset(self) -> None:
        self.inner.reset()
        self.fallen = False

    def targets(self, reading: Reading, command: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " j"]:
        """The inner controller's targets; after a fall the current positions [rad]."""
        self.fallen = self.fallen or float(reading.gravity_b[2]) > -FALL_TILT_COS
        if self.fallen:
            return np.array(reading.joint_pos)
        return self.inner.targets(reading, command)


TIMESTEP_S = 0.002
"""Timestep of the simulation and period of the low state [s]."""
COMMAND_SLEW = 1.0
"""Rate limit of the command [m/s^2 or rad/s^2], as in the deployment."""

NOISE = SensorNoise(gyro=0.02, gravity=0.005, joint_pos=0.001, joint_vel=0.05)
"""Noise of the sensor readings that the controller receives."""

Waypoint = tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class VirtualTrial:
    """Command, deviations and events of a trial."""

    command: tuple[Waypoint, ...]
    """Waypoints: start time [s], forward and left velocity [m/s], yaw rate [rad/s]."""
    seconds: float
    deviations: Deviations = field(default_factory=Deviations)
    pushes: tuple[Push, ...] = ()
    hold: Hold | None = None
    stop_s: float | None = None
    """Time of the operator's stop, after which joints are only damped [s]."""
    outages: tuple[Outage, ...] = ()
    """Times at which motors give no torque."""

    def words(self) -> tuple[str, ...]:
        """Descriptions of what differs from the model, for the log."""
        return (*self.deviations.words(), *(outage.word() for outage in self.outages))


def simulate(
    robot: Robot,
    controller: Controller,
    trial: VirtualTrial,
    rng: np.random.Generator,
    facts: LogFacts,
    *,
    every: int = 1,
) -> tuple[Rollout, RobotLog]:
    """Simulate a trial; return the rollout and its log.

    Args:
        robot: the nominal robot
        controller: policy or script
        trial: command, deviations and events
        rng: draws sensor noise and losses
        facts: facts of the log
        every: log every n-th timestep
    """
    deviations, gains = trial.deviations, trial.deviations.gain_scale
    task, command = controller.task, command_of(trial.command)
    envelope = envelope_of(robot, deviations, motor_envelope(robot))
    motors = PdControl(kp=gains * task.kp, kd=gains * task.kd, envelope=envelope)
    rollout = run(
        robot,
        _plant(robot, trial),
        FallGuard(controller),
        _failing(motors, robot, trial),
        lambda time_s: deviations.command_scale * command(time_s),
        trial.seconds,
        trial.pushes,
        sensors=NoisySensors(NOISE, rng),
        delay_s=deviations.delay_s,
        wrench_every=5,
    )
    rollout = dataclasses.replace(rollout, command=rollout.command / deviations.command_scale)
    losses = {"message_loss": deviations.message_loss, "motor_loss_hz": deviations.motor_loss_hz}
    quality = dataclasses.replace(SOUND, **{name: value for name, value in losses.items() if value is not None})
    heating = by_joint(robot, deviations.hot, 1.0)
    heat = {name: HeatModel(heating=float(each)) for name, each in zip(robot.joint_names, heating, strict=True)}
    # only intended events: the log's reader has to detect pushes
    stops = [] if trial.stop_s is None else [OperatorEvent(time_s=trial.stop_s, kind="stop")]
    notes = {**facts.notes, "simulated in": "MuJoCo", "differs from the model": "; ".join(trial.words()) or "no"}
    facts = dataclasses.replace(facts, events=(*facts.events, *stops), notes=notes)
    log = record(rollout, task.kp, task.kd, facts, rng, quality=quality, heat=heat, every=every)
    return rollout, _stopped(log, trial.stop_s)


def _failing(motors: PdControl, robot: Robot, trial: VirtualTrial) -> PdControl:
    """Add the trial's outages and stop to the motors; unchanged without any."""
    if trial.stop_s is None and not trial.outages:
        return motors
    return FailingMotors(
        **vars(motors),
        timestep_s=TIMESTEP_S,
        stop_s=np.inf if trial.stop_s is None else trial.stop_s,
        outages=tuple((outage, joints_of(robot, outage)) for outage in trial.outages),
    )


def _plant(robot: Robot, trial: VirtualTrial) -> MujocoPlant:
    options = MujocoOptions(
        timestep_s=TIMESTEP_S, friction=trial.deviations.friction, root_mass_factor=trial.deviations.root_mass_factor
    )
    return MujocoPlant(robot, options) if trial.hold is None else HeldPlant(robot, options, trial.hold)


def _stopped(log: RobotLog, stop_s: float | None) -> RobotLog:
    """The log with zero stiffness after the stop."""
    if stop_s is None or log.joint_ctrl is None:
        return log
    late = (log.joint_ctrl.time_ns - log.joint_ctrl.time_ns[0]) * 1e-9 >= stop_s
    kp = np.where(late[:, None], 0.0, log.joint_ctrl.kp)
    return dataclasses.replace(log, joint_ctrl=dataclasses.replace(log.joint_ctrl, kp=kp))


def command_of(waypoints: Sequence[Waypoint]) -> Callable[[float], np.ndarray]:
    """The command over time, rate-limited from standing to each waypoint."""
    table = np.array([(-np.inf, 0.0, 0.0, 0.0), *sorted(waypoints)])
    values, now = [], np.zeros(3)
    for time_s in np.arange(0.0, table[-1, 0] + 60.0, 0.02):
        goal = table[np.searchsorted(table[:, 0], time_s, side="right") - 1, 1:]
        now = now + np.clip(goal - now, -0.02 * COMMAND_SLEW, 0.02 * COMMAND_SLEW)
        values.append(now)
    return lambda time_s: values[min(round(time_s / 0.02), len(values) - 1)]
