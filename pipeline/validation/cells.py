"""The cells of the protocol: trials, and the figures that are evaluated."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pipeline.simulation.sensors import SensorNoise
from pipeline.validation.trial import CommandProfile, Conditions, GroundSpec, Start, Trial, VelocityCommand

TRACKING = ("falls", "speed_error", "yaw_rate_error", "power", "slip", "saturation")
STANDING = ("falls", "speed_error", "yaw_rate_error", "drift", "steps", "saturation")
SURVIVING = ("survival",)

COMMAND_S, MEASURE_S = 10.0, 4.0
"""Length of a command trial and start of its measurement [s]: the last 6 s are measured."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """Trials that are evaluated together."""

    name: str
    group: str
    figures: tuple[str, ...]
    """Names of the evaluated figures, of `figures.FIGURES`."""
    trials: tuple[Trial, ...]


def command_cells(seeds: Sequence[int]) -> tuple[Cell, ...]:
    """The 16 commands of the published sweep, each slewed from standing."""
    forward = [VelocityCommand(forward=value) for value in (-0.6, -0.3, 0.0, 0.3, 0.6, 1.0, 1.5, 2.0)]
    lateral = [VelocityCommand(lateral=value) for value in (-0.6, -0.3, 0.3, 0.6)]
    turning = [VelocityCommand(yaw_rate=value) for value in (-1.5, -1.0, 1.0, 1.5)]
    return tuple(_steady(name_of(each), "commands", each, seeds) for each in (*forward, *lateral, *turning))


def turning_cells(seeds: Sequence[int]) -> tuple[Cell, ...]:
    """Walking on a curve in both directions, so that the heading covers a full turn."""
    pairs = ((0.6, 0.8), (0.6, -0.8), (1.0, 0.5), (1.0, -0.5))
    curves = [VelocityCommand(forward=speed, yaw_rate=rate) for speed, rate in pairs]
    return tuple(_steady(f"curve {name_of(each)}", "turning", each, seeds) for each in curves)


def step_cells(seeds: Sequence[int]) -> tuple[Cell, ...]:
    """Commands that change suddenly."""
    jumps = {
        "step 0 to 1.0": (VelocityCommand(forward=1.0),),
        "step 0 to 2.0": (VelocityCommand(forward=2.0),),
        "step 0 to yaw +1": (VelocityCommand(yaw_rate=1.0),),
        "step 0 to yaw -1": (VelocityCommand(yaw_rate=-1.0),),
        "step 0.6 to 1.5": (VelocityCommand(forward=0.6), VelocityCommand(start_s=3.0, forward=1.5)),
        "step 1.5 to 0.6": (VelocityCommand(forward=1.5), VelocityCommand(start_s=4.0, forward=0.6)),
        "step 1.0 to stand": (VelocityCommand(forward=1.0), VelocityCommand(start_s=4.0)),
        "step yaw +1 to yaw -1": (VelocityCommand(yaw_rate=1.0), VelocityCommand(start_s=3.0, yaw_rate=-1.0)),
        "step left to right": (VelocityCommand(lateral=0.6), VelocityCommand(start_s=3.0, lateral=-0.6)),
    }
    return tuple(
        _cell(name, "steps", commands, seeds, seconds=commands[-1].start_s + 7.0, slew=None)
        for name, commands in jumps.items()
    )


def switch_cells(seeds: Sequence[int]) -> tuple[Cell, ...]:
    """Sequences of walking, running, standing and turning, with rate-limited commands."""
    walk, run, stand = {"forward": 0.6}, {"forward": 2.0}, {}
    courses = {
        "walk run stand": (walk, run, stand),
        "run walk": (run, walk),
        "walk stand walk": (walk, stand, walk),
        "forward back": ({"forward": 0.8}, {"forward": -0.6}),
        "forward left turn": ({"forward": 0.8}, {"lateral": 0.6}, {"yaw_rate": 1.0}),
    }
    return tuple(
        _cell(
            f"switch {name}",
            "switches",
            tuple(VelocityCommand(start_s=4.0 * place, **each) for place, each in enumerate(course)),
            seeds,
            seconds=4.0 * (len(course) - 1) + 7.0,
        )
        for name, course in courses.items()
    )


def start_cells(seeds: Sequence[int]) -> tuple[Cell, ...]:
    """Perturbed starts, about as much as by a push or by a person's hands."""
    wide = Start(joint_pos=0.15, joint_vel=1.0, lin_vel=0.3, ang_vel=0.5, tilt=0.1)
    cells = []
    for name, command in (("standing", VelocityCommand()), ("walking", VelocityCommand(forward=0.6))):
        trials = tuple(
            Trial(seed=seed, command=CommandProfile(commands=(command,)), seconds=5.0, measure_s=3.0, start=wide)
            for seed in seeds
        )
        cells.append(Cell(name=f"start perturbed {name}", group="starts", figures=SURVIVING, trials=trials))
    return tuple(cells)


def name_of(command: VelocityCommand) -> str:
    """Name such as `vx +0.6`, of the components that are not zero; `stand` if all are."""
    parts = {"vx": command.forward, "vy": command.lateral, "yaw": command.yaw_rate}
    return " ".join(f"{name} {value:+.1f}" for name, value in parts.items() if value) or "stand"


def _steady(
    name: str, group: str, command: VelocityCommand, seeds: Sequence[int], conditions: Conditions | None = None
) -> Cell:
    return _cell(name, group, (command,), seeds, seconds=COMMAND_S, measure_s=MEASURE_S, conditions=conditions)


def _cell(
    name: str,
    group: str,
    commands: tuple[VelocityCommand, ...],
    seeds: Sequence[int],
    *,
    seconds: float,
    measure_s: float | None = None,
    slew: float | None = 1.0,
    conditions: Conditions | None = None,
) -> Cell:
    """The last command is measured, by default from 3 s after it starts."""
    trial = Trial(
        seed=0,
        command=CommandProfile(commands=commands, slew=slew),
        seconds=seconds,
        measure_s=commands[-1].start_s + 3.0 if measure_s is None else measure_s,
        conditions=conditions or Conditions(),
    )
    figures = STANDING if commands[-1].goal == (0.0, 0.0, 0.0) else TRACKING
    return Cell(name=name, group=group, figures=figures, trials=tuple(replace(trial, seed=seed) for seed in seeds))


NOISE = SensorNoise(gyro=0.1, gravity=0.02, joint_pos=0.01, joint_vel=0.5)
"""Half widths of the noise, several times those of such a robot's encoders and gyro at rest (estimate)."""

FRICTIONS = (0.3, 0.4, 0.6, 0.8, 1.2)
DELAYS_MS = (10, 20, 30, 40)
GRASS_FRICTION = 0.8
"""Friction coefficient of grass (estimate)."""

TERRAINS: dict[str, tuple[GroundSpec, float]] = {
    "rough 2 cm": (GroundSpec(kind="rough", size=0.02), 1.0),
    "rough 4 cm": (GroundSpec(kind="rough", size=0.04), 1.0),
    "grass slope 5 up": (GroundSpec(kind="slope", size=5.0), GRASS_FRICTION),
    "grass slope 5 down": (GroundSpec(kind="slope", size=-5.0), GRASS_FRICTION),
    "grass slope 5 across": (GroundSpec(kind="cross_slope", size=5.0), GRASS_FRICTION),
    "grass slope 10 up": (GroundSpec(kind="slope", size=10.0), GRASS_FRICTION),
    "grass slope 10 down": (GroundSpec(kind="slope", size=-10.0), GRASS_FRICTION),
    "grass slope 10 across": (GroundSpec(kind="cross_slope", size=10.0), GRASS_FRICTION),
    "gravel 2 cm": (GroundSpec(kind="gravel", size=0.02), 1.0),
    "gravel 3 cm": (GroundSpec(kind="gravel", size=0.03), 1.0),
    "stepping stones": (GroundSpec(kind="stones", size=0.01), 1.0),
    "speed bump 3 cm": (GroundSpec(kind="bump", size=0.03), 1.0),
}
"""Ground and friction, by name."""
TERRAIN_FIGURES = ("falls", "speed_error")


def terrain_cells(seeds: Sequence[int]) -> tuple[Cell, ...]:
    """Each terrain, walked over for 12 s; random terrain differs by seed."""
    command = CommandProfile(commands=(VelocityCommand(forward=0.6),))
    cells = []
    for name, (ground, friction) in TERRAINS.items():
        trials = []
        for seed in seeds:
            drawn = replace(ground, seed=seed) if ground.kind in ("gravel", "stones", "rough") else ground
            conditions = Conditions(friction=friction, ground=drawn)
            trials.append(Trial(seed=seed, command=command, seconds=12.0, measure_s=4.0, conditions=conditions))
        cells.append(Cell(name=f"terrain {name}", group="terrain", figures=TERRAIN_FIGURES, trials=tuple(trials)))
    return tuple(cells)


def condition_cells(seeds: Sequence[int]) -> tuple[Cell, ...]:
    """Forward at 1 m/s and turning at 1 rad/s under each condition."""
    return tuple(
        _steady(f"{name} {name_of(command)}", "conditions", command, seeds, conditions)
        for name, conditions in _conditions().items()
        for command in (VelocityCommand(forward=1.0), VelocityCommand(yaw_rate=1.0))
    )


def _conditions() -> dict[str, Conditions]:
    return {
        **{f"friction {value:g}": Conditions(friction=value) for value in FRICTIONS},
        **{f"delay {value} ms": Conditions(delay_s=value / 1000.0) for value in DELAYS_MS},
        "sensor noise": Conditions(noise=NOISE),
        **{f"trunk mass x{value:g}": Conditions(root_mass_factor=value) for value in (0.8, 1.2)},
        **{f"gains x{value:g}": Conditions(gain_factor=value) for value in (0.9, 1.1)},
    }


def unpushed_cells(seeds: Sequence[int], starts: Sequence[int]) -> tuple[Cell, ...]:
    """All cells without a push; `starts` are the seeds of perturbed starts."""
    return (
        *command_cells(seeds),
        *turning_cells(seeds),
        *step_cells(seeds),
        *switch_cells(seeds),
        *start_cells(starts),
        *terrain_cells(seeds),
        *condition_cells(seeds),
    )
