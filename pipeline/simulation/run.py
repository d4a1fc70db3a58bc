"""Control loop of a controller and a plant, used for the rollouts in all engines."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from pipeline.deployment.controller import Reading
from pipeline.deployment.task import DeploymentTask
from pipeline.errors import PipelineError
from pipeline.files.ranges import NOT_NEGATIVE, POSITIVE
from pipeline.robot import Robot
from pipeline.simulation.plant import Event, Kick, Plant, PlantState, Push
from pipeline.simulation.record import Record, Rollout
from pipeline.simulation.sensors import PerfectSensors, Sensors
from pipeline.simulation.torque_envelope import PdControl

FALL_HEIGHT_SHARE = 0.45 / 0.679103
"""Root height over the ground below which a robot has fallen, as a share of the default (T1: 0.45 m)."""
FALL_TILT_COS = 0.5
"""Cosine of the root's tilt (60 degrees) beyond which a robot has fallen."""

Command = Callable[[float], Float[np.ndarray, " 3"]]
"""Commanded forward and lateral velocity [m/s] and yaw rate [rad/s] at a time [s]."""


@dataclass(frozen=True, kw_only=True)
class Segment:
    """A segment of a walk with one commanded velocity."""

    seconds: Annotated[float, POSITIVE]
    command: tuple[float, float, float]
    """Forward and lateral [m/s], yaw rate [rad/s]."""
    slew: Annotated[float, NOT_NEGATIVE] = 1.0
    """Rate of the transition to the command [m/s^2 or rad/s^2]; 0: immediate."""


def command_of(segments: Sequence[Segment]) -> Command:
    """The command over time; each segment starts from the value that the previous one reached."""
    starts, times = [np.zeros(3)], [0.0]
    for segment in segments:
        starts.append(_slewed(starts[-1], segment, segment.seconds))
        times.append(times[-1] + segment.seconds)

    def command(time_s: float) -> Float[np.ndarray, " 3"]:
        index = min(int(np.searchsorted(times, time_s + 1e-9, side="right")), len(segments)) - 1
        return _slewed(starts[index], segments[index], time_s - times[index])

    return command


def _slewed(start: np.ndarray, segment: Segment, time_s: float) -> np.ndarray:
    most = segment.slew * time_s if segment.slew > 0.0 else np.inf
    return start + np.clip(np.array(segment.command) - start, -most, most)


GroundHeight = Callable[[float, float], float]
"""Height of the ground [m] at x, y [m]."""


@runtime_checkable
class Controller(Protocol):
    """`PolicyController`, or a replacement."""

    task: DeploymentTask

    def reset(self) -> None: ...

    def targets(self, reading: Reading, command: np.ndarray) -> np.ndarray: ...


class RateError(PipelineError):
    """Raised if a control step is not a multiple of the timestep."""

    def __init__(self, timestep_s: float, control_hz: float):
        super().__init__(
            f"a timestep of {timestep_s:g} s does not divide the control step of {1.0 / control_hz:g} s; choose one "
            "that does, as 0.001, 0.002 or 0.005 s at 50 Hz."
        )


def run(
    robot: Robot,
    plant: Plant,
    controller: Controller,
    motors: PdControl,
    command: Command,
    seconds: float,
    events: Sequence[Event] = (),
    *,
    sensors: Sensors | None = None,
    start: PlantState | None = None,
    delay_s: float = 0.0,
    wrench_every: int = 1,
    ground_height: GroundHeight | None = None,
    stop_on_fall: bool = False,
    resume_s: float | None = None,
) -> Rollout:
    """Restart `plant` and control it until `seconds`.

    Args:
        robot: the robot of controller and plant
        plant: the physics
        controller: called for targets `task.control_hz` times a second
        motors: turn targets into torque at each timestep
        command: the command to the controller
        seconds: time of the end
        events: pushes, kicks and throws
        sensors: the controller's measurements of the state; default: exact
        start: initial state; default: the plant's own
        delay_s: delay of the targets at the motors
        wrench_every: foot forces are read every this many timesteps, and held in between
        ground_height: height of the ground, from which falls are measured; default: 0
        stop_on_fall: end with the control step in which the robot fell; a simulation that diverged ends anyway
        resume_s: continue from this time with plant and controller as they are, instead of restarting; without delay

    Raises RateError, and NoBallError for a Throw that the plant can't do.
    """
    decimation = steps_of(controller.task.control_hz, plant.timestep_s)
    sensors = sensors or PerfectSensors()
    if resume_s is None:
        plant.reset(start)
        controller.reset()
    pending = deque([controller.task.default_joint_pos.copy()] * round(delay_s / plant.timestep_s))
    ticks = round(seconds * controller.task.control_hz)
    first = round((resume_s or 0.0) * controller.task.control_hz)
    record = Record(first, ticks, decimation, len(robot.joint_names))
    lowest = fall_height(robot)
    wrench = np.zeros((2, 6))
    for tick in range(first, ticks):
        state = plant.state()
        commanded = command(tick * decimation * plant.timestep_s)
        reading = sensors.read(state)
        target = controller.targets(reading, commanded)
        record.control(tick, commanded, target)
        for step in range(tick * decimation, (tick + 1) * decimation):
            pending.append(target)
            applied = pending.popleft()
            force_w = _force(events, step, plant)
            state = plant.state()
            torque = motors.torque(applied, state.joint_pos, state.joint_vel)
            plant.step(torque, force_w)
            if step % wrench_every == 0:
                wrench = plant.foot_wrench_w()
            record.step(step, state, torque, wrench, plant.acceleration())
        if not record.fell and has_fallen(plant.state(), lowest, ground_height):
            record.fall_tick = tick
            if stop_on_fall or not np.isfinite(plant.state().root_pos_w).all():
                break
    return record.rollout(robot, plant.timestep_s)


def steps_of(control_hz: float, timestep_s: float) -> int:
    """Number of timesteps per control step. Raises RateError."""
    ratio = 1.0 / (control_hz * timestep_s)
    if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < 1:
        raise RateError(timestep_s, control_hz)
    return round(ratio)


def fall_height(robot: Robot) -> float:
    """Height [m] of the root over the ground below which the robot has fallen."""
    return FALL_HEIGHT_SHARE * robot.default_root_height


def has_fallen(state: PlantState, lowest: float, ground_height: GroundHeight | None) -> bool:
    """Whether the root is below `lowest` [m], tilted beyond 60 degrees, or not finite."""
    x, y, z = state.root_pos_w.tolist()
    if not np.isfinite(state.root_pos_w).all():
        return True
    if ground_height is not None:
        z -= ground_height(x, y)
    upright = 1.0 - 2.0 * float(state.root_quat_w[1] ** 2 + state.root_quat_w[2] ** 2)
    return z < lowest or upright < FALL_TILT_COS


def _force(events: Sequence[Event], step: int, plant: Plant) -> np.ndarray | None:
    """Sum of the pushes that act in a timestep. Kicks and throws that begin in it are applied to the plant."""
    force = None
    for event in events:
        first = round(event.start_s / plant.timestep_s)
        if isinstance(event, Push):
            if first <= step < round((event.start_s + event.duration_s) / plant.timestep_s):
                force = event.force_w if force is None else force + event.force_w
        elif isinstance(event, Kick):
            if step == first:
                plant.kick(event.delta_v_w)
        elif step == first:
            plant.throw(event.direction_w, event.speed)
        elif step - first == round(event.duration_s / plant.timestep_s):
            plant.remove_ball()
    return force
