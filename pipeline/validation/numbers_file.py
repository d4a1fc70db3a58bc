"""Numbers of measured cells in a JSON file, so that bars can be derived again without rollouts."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import FileError
from pipeline.files import atomic, digest
from pipeline.validation.cells import Cell
from pipeline.validation.deployed import Deployed
from pipeline.validation.measure import Measured


def cell_digest(one: Deployed, cell: Cell) -> str:
    """Digest of everything that a cell's numbers depend on, except the code."""
    task, policy, motors = one.task, one.policy, one.envelope
    arrays = [task.kp, task.kd, task.default_joint_pos, policy.mean, policy.scale]
    arrays += [part for layer in policy.layers for part in layer]
    arrays += [motors.limit, motors.knee_speed, motors.no_load_speed, one.armature]
    parts = ["" if each is None else digest.of_bytes(np.ascontiguousarray(each).tobytes()) for each in arrays]
    plain = [task.joint_names, task.policy_joints, task.action_scale, task.history, task.control_hz]
    trials = [repr(trial) for trial in cell.trials]
    return digest.of_json([one.robot.digest, plain, parts, type(one.reads).__name__, trials])


def write_numbers(path: Path, one: Deployed, measured: Sequence[Measured]) -> None:
    """Add the numbers of cells to a file; other entries are kept."""
    known = _read(path)
    for each in measured:
        known[cell_digest(one, each.cell)] = {"cell": each.cell.name, "trials": list(each.trials)}
    lines = [f'"{key}": {json.dumps(value, sort_keys=True)}' for key, value in sorted(known.items())]
    atomic.write_text(path, "{\n" + ",\n".join(lines) + "\n}\n")


def read_numbers(path: Path, one: Deployed, cells: Sequence[Cell]) -> dict[str, Measured]:
    """The cells that the file contains, by name."""
    known = _read(path)
    entries = {cell.name: (cell, known.get(cell_digest(one, cell))) for cell in cells}
    return {
        name: Measured(cell=cell, trials=tuple(found["trials"]))
        for name, (cell, found) in entries.items()
        if found is not None
    }


def _read(path: Path) -> dict[str, Any]:
    if not path.is_file():
        return {}
    try:
        return json.loads(path.read_text())
    except (ValueError, RecursionError) as error:
        raise FileError(path, f"is no JSON ({error}).", "Remove it.") from error
