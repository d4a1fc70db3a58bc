"""Choose a run's checkpoint: the best in a noise-free sweep in plain MuJoCo.

The sweep is `pipeline.validation.sweep`: the 16 commands, steps to 2.0 m/s and to turning from rest, friction 0.4 and
1.2, pushes as a 0.1 s force. The score is a penalty; the lowest wins, and of equal ones the later:

    10 falls in cells without pushes + mean error of the 16 commands / 0.05 + 2 (1 - mean survival of pushes)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.batch import ClipPool
from pipeline.validation.deployed import Deployed
from pipeline.validation.measure import Measured, measure
from pipeline.validation.sweep import sweep_cells

FALL, ERROR, PUSHES = 10.0, 1.0 / 0.05, 2.0
"""Weights of the score: per fall, per error [s/m, s/rad], per share of pushes not survived."""


@dataclass(frozen=True, kw_only=True)
class Swept:
    """A checkpoint's figures in the sweep."""

    iteration: int
    falls: int
    """Falls in trials without a push."""
    command_error: float
    """Mean error of speed or yaw rate over the 16 commands [m/s, rad/s]; a fall counts as the whole command."""
    survival: float
    """Mean survival over the push cells."""

    @property
    def score(self) -> float:
        """The penalty; lower is better."""
        return FALL * self.falls + ERROR * self.command_error + PUSHES * (1.0 - self.survival)

    def to_dict(self) -> dict[str, Any]:
        return {**vars(self), "score": round(self.score, 6)}


def sweep_checkpoints(checkpoints: Mapping[int, Deployed], pool: ClipPool | None = None) -> tuple[Swept, ...]:
    """The figures of each checkpoint, by iteration."""
    found = []
    for iteration, one in sorted(checkpoints.items()):
        found.append(swept(iteration, measure(one, sweep_cells(one.robot), pool)))
    return tuple(found)


def swept(iteration: int, rows: Sequence[Measured]) -> Swept:
    """The figures of a checkpoint from its measured cells."""
    pushes = [row for row in rows if row.cell.group.startswith("pushes")]
    others = [row for row in rows if not row.cell.group.startswith("pushes")]
    commands = [row for row in rows if row.cell.group == "commands"]
    return Swept(
        iteration=iteration,
        falls=sum(len(row.fallen) for row in others),
        command_error=float(np.mean([error_of(row) for row in commands])),
        survival=float(np.mean([1.0 - len(row.fallen) / len(row.trials) for row in pushes])) if pushes else 0.0,
    )


def error_of(row: Measured) -> float:
    """Mean error of a command's trials on the commanded axis; a fall counts as the whole command."""
    (goal,) = {trial.command.last.goal for trial in row.cell.trials}
    axis = int(np.argmax(np.abs(goal)))
    name = ("forward", "lateral", "yaw_rate")[axis]
    return float(np.mean([abs(numbers.get(name, 0.0) - goal[axis]) for numbers in row.trials]))


def best(found: Sequence[Swept]) -> Swept:
    """The checkpoint with the lowest score; of equal ones the later."""
    return min(found, key=lambda each: (round(each.score, 9), -each.iteration))
