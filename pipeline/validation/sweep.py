"""Figures of a checkpoint, without noise or thresholds: `python -m pipeline.validation.sweep POLICY.npz`.

The 16 commands, steps from rest, two frictions and pushes, one row per cell, all from the default pose (seed 0).
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.batch import ClipPool
from pipeline.deployment import load_policy
from pipeline.errors import PipelineError
from pipeline.files import atomic
from pipeline.robot import Robot
from pipeline.validation.cells import Cell, command_cells
from pipeline.validation.deployed import deployed
from pipeline.validation.measure import Measured, measure
from pipeline.validation.suites import named

OTHERS = {
    "step 0 to 2.0": 1,
    "step 0 to yaw +1": 1,
    "step 0 to yaw -1": 1,
    "curve vx +0.6 yaw +0.8": 1,
    "friction 0.4 vx +1.0": 1,
    "friction 1.2 vx +1.0": 1,
    "push force standing 20 Ns": 8,
    "push force standing 30 Ns": 8,
    "push force standing 40 Ns": 8,
    "push force standing 50 Ns": 8,
    "push force walking 20 Ns": 16,
    "push force walking 30 Ns": 16,
    "push force walking 40 Ns": 16,
    "push force walking 50 Ns": 16,
}
"""Cells besides the commands -> number of trials."""

COLUMNS = ("forward", "lateral", "yaw_rate", "power", "slip", "saturation", "drift", "steps")


def sweep_cells(robot: Robot) -> tuple[Cell, ...]:
    """The cells of the sweep, all from the default pose."""
    return tuple(
        dataclasses.replace(cell, trials=tuple(dataclasses.replace(trial, seed=0) for trial in cell.trials))
        for cell in (*command_cells((0,)), *named(robot, OTHERS))
    )


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


if __name__ == "__main__":
    sys.exit(main())
