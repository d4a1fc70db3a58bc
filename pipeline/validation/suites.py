"""The cells of each suite."""

from __future__ import annotations

import dataclasses

from pipeline.errors import UnknownNameError
from pipeline.robot import Robot
from pipeline.validation.cells import (
    Cell,
    command_cells,
    start_cells,
    step_cells,
    switch_cells,
    turning_cells,
)
from pipeline.validation.condition_cells import condition_cells, terrain_cells
from pipeline.validation.push_cells import push_cells

FULL, QUICK = "full", "quick"
SUITES = (QUICK, FULL)
SEEDS = (1, 2, 3, 4, 5)
STARTS = 20

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
the reference policy survives completely: a share over 64 trials says little about 8."""


def cells_of(suite: str, robot: Robot) -> tuple[Cell, ...]:
    """The cells of a suite by name. Raises UnknownNameError."""
    if suite == FULL:
        return full(robot)
    if suite == QUICK:
        return quick(robot)
    raise UnknownNameError("suite", suite, SUITES)


def full(robot: Robot) -> tuple[Cell, ...]:
    """All cells of the full suite."""
    return (
        *command_cells(SEEDS),
        *turning_cells(SEEDS),
        *step_cells(SEEDS),
        *switch_cells(SEEDS),
        *start_cells(STARTS),
        *terrain_cells(SEEDS),
        *condition_cells(SEEDS),
        *push_cells(robot),
    )


def quick(robot: Robot) -> tuple[Cell, ...]:
    """Each command once and the first trials of `QUICK_CELLS`, identical to those of the full suite."""
    counts = {cell.name: 1 for cell in command_cells(SEEDS)} | QUICK_CELLS
    return tuple(
        dataclasses.replace(cell, trials=cell.trials[: counts[cell.name]])
        for cell in full(robot)
        if cell.name in counts
    )


def named(robot: Robot, names: dict[str, int]) -> tuple[Cell, ...]:
    """Cells of the full suite by name, each with its first n trials. Raises UnknownNameError."""
    known = {cell.name: cell for cell in full(robot)}
    for name in names:
        if name not in known:
            raise UnknownNameError("cell", name, tuple(known))
    return tuple(dataclasses.replace(known[name], trials=known[name].trials[:count]) for name, count in names.items())
