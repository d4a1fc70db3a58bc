"""Figures of a checkpoint on development trials: `python -m pipeline.validation.sweep POLICY.npz`.

It has the cells of the full suite without a push, and pushes as a 0.1 s force. Its seeds, start poses, push times and
push directions are in no suite: checkpoints are not chosen by the trials that evaluate them. A run's checkpoint is
chosen by this sweep in plain MuJoCo. The score is a penalty; the lowest wins, in a tie the later one:

    10 falls + required cells that miss a threshold + mean error of the 16 commands / 0.05
    + 2 (1 - mean survival of pushes)

Falls count in required cells that allow none, missed thresholds in required cells. Cells without thresholds, of which
the K1 has many, count only as commands and pushes.
"""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.batch import ClipPool
from pipeline.deployment import load_policy
from pipeline.errors import PipelineError
from pipeline.files import atomic
from pipeline.robot import Robot
from pipeline.validation.bars import ValidationSettings
from pipeline.validation.cells import Cell, unpushed_cells
from pipeline.validation.deployed import Deployed, deployed
from pipeline.validation.figures import Measured, measure
from pipeline.validation.suites import Trials, named
from pipeline.validation.verdict import judge

PUSHED = {
    "push force standing 20 Ns": 8,
    "push force standing 30 Ns": 8,
    "push force standing 40 Ns": 8,
    "push force standing 50 Ns": 8,
    "push force walking 20 Ns": 16,
    "push force walking 30 Ns": 16,
    "push force walking 40 Ns": 16,
    "push force walking 50 Ns": 16,
}
"""Cells with a push -> number of trials."""

TRIALS = Trials(seeds=(6, 7, 8, 9, 10), starts=range(41, 61), shift=0.3)
"""Development trials: none is in a suite, and a cell has as many as in the suites. With two seeds per cell, a
checkpoint passed that kept stepping in one of five stops."""

COLUMNS = ("forward", "lateral", "yaw_rate", "power", "slip", "saturation", "drift", "steps")


def sweep_cells(robot: Robot) -> tuple[Cell, ...]:
    return (*unpushed_cells(TRIALS.seeds, TRIALS.starts), *named(robot, PUSHED, TRIALS))


def table(rows: Sequence[Measured]) -> str:
    """One line per cell: survival, then the mean figures of the trials that did not fall."""
    lines = [f"{'cell':28s} {'survival':>8s} " + " ".join(f"{name:>10s}" for name in COLUMNS)]
    for row in rows:
        means = [row.spread(name).get("mean") for name in COLUMNS] if "survival" not in row.cell.figures else []
        cells = " ".join(f"{'-' if mean is None else format(mean, '.3f'):>10s}" for mean in means)
        lines.append(f"{row.cell.name:28s} {row.figure('survival'):8.2f} {cells}".rstrip())
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m pipeline.validation.sweep", description=__doc__)
    parser.add_argument("policy", type=Path, help="npz of a policy")
    parser.add_argument("--robot", type=Path, default=Path("robots/t1"), help="folder of the robot, adapted or not")
    parser.add_argument("--workers", type=int, default=1, help="processes; 0 for one each core")
    parser.add_argument("--json", type=Path, help="write the numbers of each cell here")
    given = parser.parse_args(arguments)
    try:
        one = deployed(given.robot, load_policy(given.policy))
        rows = measure(one, sweep_cells(one.robot), ClipPool(workers=given.workers))
        print(table(rows))
        if given.json:
            found = {row.cell.name: list(row.trials) for row in rows}
            atomic.write_text(given.json, json.dumps(found, indent=1, sort_keys=True) + "\n")
    except PipelineError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


FALL, ERROR, PUSHES = 10.0, 1.0 / 0.05, 2.0
"""Weights of the score: per fall, per error [s/m, s/rad], per share of pushes not survived; a missed cell weighs 1."""


@dataclass(frozen=True, kw_only=True)
class SweepResult:
    """A checkpoint's figures in the sweep."""

    iteration: int
    falls: int
    """Falls in trials of required cells that allow none."""
    missed: int
    """Required cells with a figure that misses its threshold."""
    command_error: float
    """Mean error of speed or yaw rate over the 16 commands [m/s, rad/s]; a fall counts as the whole command."""
    survival: float
    """Mean survival over the push cells."""

    @property
    def score(self) -> float:
        """The penalty; lower is better."""
        return FALL * self.falls + self.missed + ERROR * self.command_error + PUSHES * (1.0 - self.survival)

    def to_dict(self) -> dict[str, Any]:
        return {**vars(self), "score": round(self.score, 6)}


def sweep_checkpoints(
    checkpoints: Mapping[int, Deployed], bars: ValidationSettings, pool: ClipPool | None
) -> tuple[SweepResult, ...]:
    """The figures of each checkpoint, by iteration."""
    return tuple(
        swept(iteration, measure(one, sweep_cells(one.robot), pool), bars)
        for iteration, one in sorted(checkpoints.items())
    )


def swept(iteration: int, rows: Sequence[Measured], bars: ValidationSettings) -> SweepResult:
    """The figures of a checkpoint from its measured cells."""
    verdict = judge(rows, bars, suite="sweep", policy="", robot="")
    pushes = [row for row in rows if row.cell.group.startswith("pushes")]
    no_falls = [cell.measured for cell in verdict.cells if cell.required and "falls" in cell.bars.bars]
    commands = [row for row in rows if row.cell.group == "commands"]
    return SweepResult(
        iteration=iteration,
        falls=sum(len(row.fallen) for row in no_falls),
        missed=len(verdict.failed_cells),
        command_error=float(np.mean([error_of(row) for row in commands])),
        survival=float(np.mean([1.0 - len(row.fallen) / len(row.trials) for row in pushes])) if pushes else 0.0,
    )


def error_of(row: Measured) -> float:
    """Mean error of a command's trials on the commanded axis [m/s or rad/s]; a fall counts as the whole command."""
    goal, reached = commanded(row)
    return float(np.mean([abs(value - goal) for value in reached]))


def commanded(row: Measured) -> tuple[float, list[float]]:
    """The command on its largest axis, and the velocity of each trial on it, 0 after a fall [m/s or rad/s]."""
    (goal,) = {trial.command.last.goal for trial in row.cell.trials}
    axis = int(np.argmax(np.abs(goal)))
    name = ("forward", "lateral", "yaw_rate")[axis]
    return goal[axis], [numbers.get(name, 0.0) for numbers in row.trials]


def best(found: Sequence[SweepResult]) -> SweepResult:
    """The checkpoint with the lowest score; in a tie the later one."""
    return min(found, key=lambda each: (round(each.score, 9), -each.iteration))


if __name__ == "__main__":
    sys.exit(main())
