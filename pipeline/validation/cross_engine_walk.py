"""One cell of the grid in one engine: the walk, and its figures."""

import dataclasses
import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pipeline import rotation
from pipeline.deployment import DeploymentTask
from pipeline.files.ranges import COUNT, NOT_NEGATIVE, POSITIVE, Range, check
from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant, bridge_plant
from pipeline.simulation.plant import Plant, PlantState, Push, standing_state
from pipeline.simulation.record import Rollout
from pipeline.simulation.run import Segment, command_of
from pipeline.validation.deployed import Deployed

LONGEST_TIMESTEP_S = 0.02
"""A figure is a mean over at least one timestep."""


@dataclass(frozen=True, kw_only=True)
class SimulationSettings:
    """Simulation settings common to all engines."""

    timestep_s: Annotated[float, Range(0.0005, LONGEST_TIMESTEP_S)]
    friction: Annotated[float, POSITIVE]
    seeds: Annotated[int, COUNT]
    """Number of starts per cell; the first is exactly the default pose."""
    start_joint_pos: Annotated[float, Range(0.0, 0.2)]
    """Half width of the other starts' joint positions about the default pose [rad]."""
    start_yaw: float
    """Half width of their heading [rad]."""


@dataclass(frozen=True, kw_only=True)
class PushSettings:
    """A push by the model `force`: a constant force at the trunk's centre of mass."""

    start_s: Annotated[float, NOT_NEGATIVE]
    impulse: tuple[float, float]
    """Forward and to the left, in the heading at the start [N s]."""
    duration_s: Annotated[float, POSITIVE] = 0.1


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One cell: commands, measured time, and an optional push."""

    segments: tuple[Segment, ...]
    measured_s: Annotated[float, Range(LONGEST_TIMESTEP_S)]
    """Length of the end over which means are taken [s], within the last segment."""
    push: PushSettings | None = None

    def __post_init__(self) -> None:
        check(_beyond(self))

    @property
    def command(self) -> tuple[float, float, float]:
        """The command that is measured."""
        return self.segments[-1].command

    @property
    def seconds(self) -> float:
        return sum(segment.seconds for segment in self.segments)


def _beyond(cell: Cell) -> list[tuple[str, str]]:
    """Faults: measured time longer than the last segment, a push after the end."""
    if not cell.segments:
        return [("segments", "is empty, allowed is at least one")]
    faults, last_s, push = [], cell.segments[-1].seconds, cell.push
    if cell.measured_s > last_s:
        faults.append(("measured_s", f"is {cell.measured_s:g}, allowed is at most the last segment's {last_s:g} s"))
    if push is not None and (end_s := push.start_s + push.duration_s) > cell.seconds + 1e-9:
        problem = f"is {push.start_s:g}, its end at {end_s:g} s is after the cell's {cell.seconds:g} s"
        faults.append(("push.start_s", problem))
    return faults


@dataclass(frozen=True, kw_only=True)
class CrossEngineSettings:
    """The whole file."""

    simulation: SimulationSettings
    cells: dict[str, Cell]


MUJOCO, BRIDGE, DART = "mujoco", "bridge", "dart"
ENGINES = (MUJOCO, BRIDGE, DART)
"""MuJoCo, MuJoCo with the armature on the links as in DART, DART."""


@dataclass(frozen=True, kw_only=True)
class Figures:
    """Figures of one walk: means over its last `measured_s` seconds, NaN after a fall."""

    fell_s: float | None
    """Time of the fall [s]."""
    forward_m_s: float
    lateral_m_s: float
    """Velocity of the root in its heading frame."""
    yaw_rate_rad_s: float
    height_m: float
    """Height of the root."""
    power_w: float
    """Sum over the joints of |torque times speed|."""

    @property
    def fell(self) -> bool:
        return self.fell_s is not None

    @property
    def velocity(self) -> tuple[float, float, float]:
        """Forward and lateral [m/s], yaw rate [rad/s]."""
        return self.forward_m_s, self.lateral_m_s, self.yaw_rate_rad_s


def make_plant(engine: str, deployed: Deployed, timestep_s: float, friction: float) -> Plant:
    """The plant of an engine, with the deployment's armature if it differs from the robot's.

    Raises PipelineError where DART can't be loaded.
    """
    robot = deployed.robot
    if deployed.armature is not None:
        robot = dataclasses.replace(robot, armature=deployed.armature)
    if engine == DART:
        from pipeline.dart.plant import DartPlant  # needs libraries that MuJoCo does not

        return DartPlant(robot, timestep_s, friction)
    options = MujocoOptions(timestep_s=timestep_s, friction=friction, armature=robot.armature)
    return bridge_plant(robot, options) if engine == BRIDGE else MujocoPlant(robot, options)


def walk_cell(deployed: Deployed, engine: str, cell: Cell, seed: int, settings: SimulationSettings) -> Figures:
    """Figures of one walk. Equal arguments give equal bits."""
    return figures_of(walk(deployed, engine, cell, seed, settings), cell.measured_s)


def walk(
    deployed: Deployed, engine: str, cell: Cell, seed: int, settings: SimulationSettings, stop_on_fall: bool = True
) -> Rollout:
    """Rollout of one cell, engine and seed."""
    start = start_state(deployed.robot, deployed.task, seed, settings)
    options = {"start": start, "wrench_every": 1000, "stop_on_fall": stop_on_fall}
    events = [] if cell.push is None else [_push(cell.push, start)]
    plant = make_plant(engine, deployed, settings.timestep_s, settings.friction)
    return deployed.walk(plant, command_of(cell.segments), cell.seconds, events=events, **options)


def start_state(robot: Robot, task: DeploymentTask, seed: int, settings: SimulationSettings) -> PlantState:
    """Start at rest: seed 0 in the default pose, others around it with a random heading."""
    rng = np.random.default_rng(seed)
    wide = settings.start_joint_pos if seed else 0.0
    joint_pos = task.default_joint_pos + rng.uniform(-wide, wide, len(robot.joint_names))
    yaw = float(rng.uniform(-1.0, 1.0)) * settings.start_yaw if seed else 0.0
    joint_pos = np.clip(joint_pos, robot.joint_lower, robot.joint_upper)
    return dataclasses.replace(standing_state(robot), root_quat_w=rotation.about_z(yaw), joint_pos=joint_pos)


def figures_of(rollout: Rollout, measured_s: float) -> Figures:
    """Means over the end of a rollout."""
    if rollout.fell:
        means = ("forward_m_s", "lateral_m_s", "yaw_rate_rad_s", "height_m", "power_w")
        return Figures(fell_s=rollout.fell_s, **dict.fromkeys(means, math.nan))
    last = slice(len(rollout.qpos) - round(measured_s / rollout.timestep_s), None)
    quat_w, qvel = rollout.qpos[last, 3:7], rollout.qvel[last]
    velocity = rotation.rotate_inverse(rotation.about_z(rotation.yaw_of(quat_w)), qvel[:, :3]).mean(axis=0)
    turning = rotation.rotate(quat_w, qvel[:, 3:6]).mean(axis=0)
    return Figures(
        fell_s=None,
        forward_m_s=float(velocity[0]),
        lateral_m_s=float(velocity[1]),
        yaw_rate_rad_s=float(turning[2]),
        height_m=float(rollout.qpos[last, 2].mean()),
        power_w=float(np.abs(rollout.torque[last] * qvel[:, 6:]).sum(axis=1).mean()),
    )


def _push(push: PushSettings, start: PlantState) -> Push:
    impulse_w = rotation.rotate(start.root_quat_w, np.array([*push.impulse, 0.0]))
    return Push(start_s=push.start_s, duration_s=push.duration_s, force_w=impulse_w / push.duration_s)
