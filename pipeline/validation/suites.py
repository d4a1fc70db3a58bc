"""The cells of each suite.

- `force`: a constant horizontal force at the trunk's centre of mass for 0.1 s, as in the published figures;
- `kick`: an instantaneous change of the whole robot's velocity by impulse / mass;
- `ball`: a 10 kg ball that hits the trunk with the speed of a drop (1.3 m in the paper). It is removed after 0.3 s, or
  later if it has to catch up with a robot that walks away. The collision determines how much of its momentum the
  robot receives.

Each figure names its model: figures of different models are different quantities. While standing still, the eight times
are equivalent.
"""

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import UnknownNameError
from pipeline.physics import GRAVITY
from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import BALL_DISTANCE, Ball
from pipeline.simulation.plant import Event, Kick, Push, Throw
from pipeline.validation.cells import SURVIVING, Cell, command_cells, unpushed_cells
from pipeline.validation.trial import CommandProfile, Conditions, Trial, VelocityCommand

IMPULSES = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
"""Impulses of pushes [N s]."""
TIMES = DIRECTIONS = 8
"""Number of push times and directions; the first direction is forward, then every 45 degrees to the left."""
STEP_S = 0.1
"""Time between consecutive push times [s]; eight cover more than a gait cycle."""
FIRST_S = {"standing": 1.0, "walking": 3.0}
"""Time of the first push [s], once the gait is steady."""
AFTER_S = 2.0
"""Time without a fall that counts as survival [s]; the published policy falls after 1.1 s at the latest."""
PUSH_S = 0.1
BALL = Ball(mass=10.0, radius=0.12)
BALL_S = 0.3
"""Least time that a ball is in the simulation [s]."""
DROPS_M = (0.1, 0.3, 0.6, 0.9, 1.3, 1.7)
"""Drop heights [m] that give the ball its speed."""
GAITS = {"standing": VelocityCommand(), "walking": VelocityCommand(forward=0.5)}


@dataclass(frozen=True, kw_only=True)
class Trials:
    """Trials of a suite's cells."""

    seeds: tuple[int, ...]
    """Seeds of all trials except perturbed starts and pushes."""
    starts: Sequence[int]
    """Seeds of perturbed starts."""
    shift: float
    """Shift of push times and directions, as a share of a step."""


JUDGED = Trials(seeds=(1, 2, 3, 4, 5), starts=range(1, 21), shift=0.0)
"""Trials of the suites that evaluate a policy."""
UNSEEN = Trials(seeds=(11, 12, 13, 14, 15), starts=range(21, 41), shift=0.6)
"""Trials of the suite `held-out`, which are in no other suite and not in the sweep that chooses a checkpoint."""


def push_cells(
    robot: Robot, models: tuple[str, ...] = ("force", "kick", "ball"), shift: float = 0.0
) -> tuple[Cell, ...]:
    """All cells of the named push models: 12 of 64 trials each."""
    return tuple(
        push_cell(robot, model, gait, size, shift)
        for model in models
        for gait in GAITS
        for size in (DROPS_M if model == "ball" else IMPULSES)
    )


def push_cell(robot: Robot, model: str, gait: str, size: float, shift: float) -> Cell:
    """The 64 trials of one push; the first 8 of any block of 8 are the directions at one time.

    Args:
        robot: its mass determines the velocity change of a kick
        model: `force, kick` or `ball`
        gait: one of `GAITS`
        size: impulse [N s]; for a ball the drop height [m]
        shift: shift of times and directions, see `Trials`
    """
    conditions = Conditions(ball=BALL) if model == "ball" else Conditions()
    trials = []
    for number in range(TIMES):
        time_s = FIRST_S[gait] + STEP_S * (number + shift)
        for part in range(DIRECTIONS):
            angle = 2.0 * math.pi * (part + shift) / DIRECTIONS
            direction = np.array([math.cos(angle), math.sin(angle), 0.0])
            trials.append(
                Trial(
                    seed=0,
                    command=CommandProfile(commands=(GAITS[gait],)),
                    seconds=time_s + AFTER_S,
                    measure_s=time_s,
                    events=(_event(robot, model, gait, size, direction, time_s),),
                    conditions=conditions,
                )
            )
    unit = "m" if model == "ball" else "Ns"
    return Cell(
        name=f"push {model} {gait} {size:g} {unit}", group=f"pushes {model}", figures=SURVIVING, trials=tuple(trials)
    )


def _event(robot: Robot, model: str, gait: str, size: float, direction_w: np.ndarray, start_s: float) -> Event:
    if model == "force":
        return Push(start_s=start_s, duration_s=PUSH_S, force_w=size / PUSH_S * direction_w)
    if model == "kick":
        return Kick(start_s=start_s, delta_v_w=size / robot.total_mass * direction_w)
    speed = ball_speed(size)
    return Throw(start_s=start_s, direction_w=direction_w, speed=speed, duration_s=ball_time(speed, gait))


def ball_speed(drop: float) -> float:
    """Speed [m/s] after falling `drop` [m]."""
    return math.sqrt(2.0 * GRAVITY * drop)


def ball_time(speed: float, gait: str) -> float:
    """Time a ball is simulated [s]: enough to reach a robot that walks straight away from it."""
    return max(BALL_S, (BALL_DISTANCE - BALL.radius) / (speed - GAITS[gait].forward))


FULL, QUICK, HELD_OUT = "full", "quick", "held-out"
SUITES = (QUICK, FULL, HELD_OUT)

QUICK_CELLS: dict[str, int] = {
    "step 0 to 2.0": 1,
    "step 0 to yaw +1": 1,
    "step 0 to yaw -1": 1,
    "curve vx +0.6 yaw +0.8": 1,
    "curve vx +0.6 yaw -0.8": 1,
    "switch walk run stand": 1,
    "friction 0.4 vx +1.0": 1,
    "friction 1.2 vx +1.0": 1,
    "terrain gravel 2 cm": 1,
    "push force standing 20 Ns": 8,
    "push force standing 30 Ns": 8,
    "push force walking 20 Ns": 8,
    "push force walking 30 Ns": 8,
    "push kick standing 40 Ns": 8,
}
"""Cells of the quick suite besides the 16 commands -> number of trials; for pushes one per direction. Only cells that
the reference policy survives completely: a share over 64 trials is not significant for 8."""


def cells_of(suite: str, robot: Robot) -> tuple[Cell, ...]:
    """The cells of a suite by name. Raises UnknownNameError."""
    if suite not in SUITES:
        raise UnknownNameError("suite", suite, SUITES)
    if suite == QUICK:
        return quick(robot)
    return full(robot, UNSEEN if suite == HELD_OUT else JUDGED)


def full(robot: Robot, trials: Trials = JUDGED) -> tuple[Cell, ...]:
    """All cells of the full suite."""
    return (*unpushed_cells(trials.seeds, trials.starts), *push_cells(robot, shift=trials.shift))


def quick(robot: Robot) -> tuple[Cell, ...]:
    """Each command once and the first trials of `QUICK_CELLS`, identical to those of the full suite."""
    counts = {cell.name: 1 for cell in command_cells(JUDGED.seeds)} | QUICK_CELLS
    return tuple(
        dataclasses.replace(cell, trials=cell.trials[: counts[cell.name]])
        for cell in full(robot)
        if cell.name in counts
    )


def named(robot: Robot, names: dict[str, int], trials: Trials = JUDGED) -> tuple[Cell, ...]:
    """Cells of the full suite by name, each with its first n trials. Raises UnknownNameError."""
    known = {cell.name: cell for cell in full(robot, trials)}
    for name in names:
        if name not in known:
            raise UnknownNameError("cell", name, tuple(known))
    return tuple(dataclasses.replace(known[name], trials=known[name].trials[:count]) for name, count in names.items())
