"""The sweep that checkpoints are chosen by on a training host, and the one that measures what was chosen.

Cells and score are those of `pipeline/validation`: the 16 commands, jumps from rest to 2.0 m/s at three frictions and
to turning, pushes as a .1 s force in eight directions; and starts with the rotors' inertia on the links, which fell
walks that hold in MuJoCo alone. What is chosen is measured anew, with other starts and more pushes: the figures it was
chosen by flatter it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.training.plain_walk import Figures, Walk

COMMANDS = tuple(
    (value if axis == 0 else 0.0, value if axis == 1 else 0.0, value if axis == 2 else 0.0)
    for axis, values in enumerate(
        ((-0.6, -0.3, 0.0, 0.3, 0.6, 1.0, 1.5, 2.0), (-0.6, -0.3, 0.3, 0.6), (-1.5, -1.0, 1.0, 1.5))
    )
    for value in values
)
"""Forward, lateral [m/s], yaw rate [rad/s]."""
JUMPS = (((2.0, 0.0, 0.0), 0.4), ((2.0, 0.0, 0.0), 0.8), ((2.0, 0.0, 0.0), 1.2), ((0.0, 0.0, 1.0), 0.8))
JUMPS += (((0.0, 0.0, -1.0), 0.8),)
"""Command from rest at once, friction."""
STARTS = ((0.6, 0.0, 0.0), (1.0, 0.0, 0.0), (1.5, 0.0, 0.0), (-0.6, 0.0, 0.0))
"""From rest with the rotors' inertia on the links, as engines without an armature have it."""
START_S = 7.0
GAITS = {"standing": (0.0, 0.0, 0.0), "walking": (0.5, 0.0, 0.0)}
DIRECTIONS = 8
PUSH_S, APART_S, AFTER_S = 4.0, 0.13, 3.5
"""First push, distance of the next ones, and how long a robot has to stay up after it."""
FALL, ERROR, PUSHES = 10.0, 1.0 / 0.05, 2.0
"""Weights of the score, those of `pipeline/validation/checkpoint_choice.py`."""


def choosing_walks() -> tuple[Walk, ...]:
    """What a checkpoint is chosen by."""
    return (*_commands((0,)), *_jumps((0,)), *_starts((0, 6)), *_pushes((40.0, 50.0), times=1))


def measuring_walks() -> tuple[Walk, ...]:
    """What the chosen one is measured by; none of these trials is one of the above."""
    seeds = (1, 2, 3, 4, 5)
    return (*_commands(seeds), *_jumps(seeds), *_starts(seeds), *_pushes((40.0, 50.0, 60.0), times=4, seed=1))


def brief_walks() -> tuple[Walk, ...]:
    """Enough to see that measuring works."""
    return (Walk(cell="command +0.6 +0.0 +0.0", command=(0.6, 0.0, 0.0), seconds=6.0), *_pushes((40.0,), times=1)[:2])


def name_of(command: Sequence[float]) -> str:
    """Of a command's cell."""
    return "command " + " ".join(f"{value:+.1f}" for value in command)


def _commands(seeds: Sequence[int]) -> list[Walk]:
    return [Walk(cell=name_of(each), command=each, seed=seed) for each, seed in itertools.product(COMMANDS, seeds)]


def _jumps(seeds: Sequence[int]) -> list[Walk]:
    return [
        Walk(
            cell=f"jump to {name_of(command)} friction {friction:.1f}",
            command=command,
            friction=friction,
            jump=True,
            seed=seed,
        )
        for (command, friction), seed in itertools.product(JUMPS, seeds)
    ]


def _starts(seeds: Sequence[int]) -> list[Walk]:
    return [
        Walk(cell=f"rotors on links, {name_of(command)}", command=command, rotors=1.0, seconds=START_S, seed=seed)
        for command, seed in itertools.product(STARTS, seeds)
    ]


def _pushes(impulses: Sequence[float], times: int, seed: int = 0) -> list[Walk]:
    found = []
    for gait, impulse, number, direction in itertools.product(GAITS, impulses, range(times), range(DIRECTIONS)):
        angle = 2.0 * math.pi * direction / DIRECTIONS
        start_s = PUSH_S + APART_S * number
        push = (impulse * math.cos(angle), impulse * math.sin(angle), start_s)
        cell = f"push {gait} {impulse:.0f} Ns"
        found.append(Walk(cell=cell, command=GAITS[gait], seconds=start_s + AFTER_S, push=push, seed=seed))
    return found


def cells_of(walks: Sequence[Walk], found: Sequence[Figures]) -> dict[str, Figures]:
    """Of each cell: share of trials that fell, their number, and the means of the others' figures."""
    cells: dict[str, list[Figures]] = {}
    for walk, figures in zip(walks, found, strict=True):
        cells.setdefault(walk.cell, []).append(figures)
    return {name: _mean(each) for name, each in cells.items()}


def _mean(each: Sequence[Figures]) -> Figures:
    upright = [figures for figures in each if not figures["fell"]]
    names = upright[0].keys() - {"fell"} if upright else ()
    fell = float(np.mean([figures["fell"] for figures in each]))
    means = {name: round(float(np.mean([figures[name] for figures in upright])), 5) for name in sorted(names)}
    return {"fell": fell, "trials": float(len(each)), **means}


def score(cells: Mapping[str, Figures]) -> dict[str, float]:
    """`falls` without a push, `command_error`, `survival` of pushes, and their penalty `score`: lower is better."""
    pushes = [cell for name, cell in cells.items() if name.startswith("push")]
    others = [cell for name, cell in cells.items() if not name.startswith("push")]
    errors = [_error(name, cell) for name, cell in cells.items() if name.startswith("command")]
    falls = sum(cell["fell"] * cell["trials"] for cell in others)
    survival = float(np.mean([1.0 - cell["fell"] for cell in pushes])) if pushes else 0.0
    error = float(np.mean(errors)) if errors else 0.0
    penalty = FALL * falls + ERROR * error + PUSHES * (1.0 - survival)
    named = {"falls": falls, "command_error": error, "survival": survival, "score": penalty}
    return {name: round(value, 6) for name, value in named.items()}


def _error(name: str, cell: Figures) -> float:
    """Error on the axis that is commanded; who fell has reached nothing of it."""
    command = [float(text) for text in name.split()[1:]]
    axis = int(np.argmax(np.abs(command)))
    wanted, figure = command[axis], ("forward", "lateral", "yaw_rate")[axis]
    upright = abs(cell[figure] - wanted) if figure in cell else 0.0
    return (1.0 - cell["fell"]) * upright + cell["fell"] * abs(wanted)
