"""Cells with deviations from the nominal world and robot: terrain, latency, noise, friction, mass, gains."""

from __future__ import annotations

from collections.abc import Iterable

from pipeline.simulation.sensors import SensorNoise
from pipeline.validation.cells import Cell, steady_cell
from pipeline.validation.trial import CommandProfile, Conditions, GroundSpec, Trial, VelocityCommand

NOISE = SensorNoise(gyro=0.1, gravity=0.02, joint_pos=0.01, joint_vel=0.5)
"""Half widths, several times those of encoders and gyro of such a robot at rest. Judgement."""

FRICTIONS = (0.3, 0.4, 0.6, 0.8, 1.2)
DELAYS_MS = (10, 20, 30, 40)
GRASS_FRICTION = 0.8
"""Judgement."""

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


def terrain_cells(seeds: Iterable[int]) -> tuple[Cell, ...]:
    """Each terrain, walked over for 12 s; random terrain differs by seed."""
    seeds, cells = tuple(seeds), []
    for name, (ground, friction) in TERRAINS.items():
        trials = [
            Trial(
                seed=seed,
                command=CommandProfile(commands=(VelocityCommand(forward=0.6),)),
                seconds=12.0,
                measure_s=4.0,
                conditions=Conditions(friction=friction, ground=_seeded(ground, seed)),
            )
            for seed in seeds
        ]
        cells.append(Cell(name=f"terrain {name}", group="terrain", figures=TERRAIN_FIGURES, trials=tuple(trials)))
    return tuple(cells)


def _seeded(ground: GroundSpec, seed: int) -> GroundSpec:
    random = ground.kind in ("gravel", "stones", "rough")
    return GroundSpec(kind=ground.kind, size=ground.size, seed=seed if random else 0)


def condition_cells(seeds: Iterable[int]) -> tuple[Cell, ...]:
    """Forward at 1 m/s and turning at 1 rad/s under each condition."""
    seeds, cells = tuple(seeds), []
    for name, conditions in _conditions().items():
        for command, word in ((VelocityCommand(forward=1.0), "vx +1.0"), (VelocityCommand(yaw_rate=1.0), "yaw +1.0")):
            cells.append(steady_cell(f"{name} {word}", "conditions", command, seeds, conditions))
    return tuple(cells)


def _conditions() -> dict[str, Conditions]:
    return {
        **{f"friction {value:g}": Conditions(friction=value) for value in FRICTIONS},
        **{f"delay {value} ms": Conditions(delay_s=value / 1000.0) for value in DELAYS_MS},
        "sensor noise": Conditions(noise=NOISE),
        **{f"trunk mass x{value:g}": Conditions(root_mass_factor=value) for value in (0.8, 1.2)},
        **{f"gains x{value:g}": Conditions(gain_factor=value) for value in (0.9, 1.1)},
    }
