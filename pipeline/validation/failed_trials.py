"""Failures are data: a trial of each failed cell, written as the log that the robot would have written of it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from pipeline.deployment import digest
from pipeline.hardware_logs.robot_log import LogFacts, OperatorEvent, RobotLog
from pipeline.hardware_logs.write import write_mcap
from pipeline.simulation.record import Rollout
from pipeline.validation.deployed import Deployed
from pipeline.validation.figures import FIGURES
from pipeline.validation.trial import Trial
from pipeline.validation.verdict import CellVerdict, Verdict
from pipeline.validation.walk import Worlds, walk
from pipeline.virtual_robot.record import record

LONGEST_NOTE = 400
"""Letters of the reasons that go into a log."""


def write_failed_trials(one: Deployed, verdict: Verdict, folder: Path) -> tuple[Path, ...]:
    """The logs of a verdict's failed cells, one MCAP file each; equal verdicts give equal bytes."""
    worlds, written = Worlds(one), []
    for cell in verdict.failed_cells:
        path = folder / f"{file_name(cell.measured.cell.name)}.mcap"
        _, log = failed_trial(worlds, cell)
        write_mcap(path, log)
        written.append(path)
    return tuple(written)


def failed_trial(worlds: Worlds, cell: CellVerdict) -> tuple[Rollout, RobotLog]:
    """The worst trial of a cell, walked again to its end whether it falls or not, and the log of it."""
    one, trial = worlds.one, worst_trial(cell)
    rollout = walk(worlds, trial, stop_on_fall=False)
    said = "; ".join(map(str, cell.reasons))
    facts = LogFacts(
        robot=one.robot.name,
        policy_digest=digest(one.policy),
        events=tuple(OperatorEvent(time_s=event.start_s, kind="pushed") for event in trial.events),
        notes={"validation cell": cell.measured.cell.name, "reasons": said[:LONGEST_NOTE], "seed": str(trial.seed)},
    )
    gains = trial.conditions.gain_factor
    rng = np.random.default_rng(trial.seed)
    return rollout, record(rollout, gains * one.task.kp, gains * one.task.kd, facts, rng)


def worst_trial(cell: CellVerdict) -> Trial:
    """The first that fell; where none did, the one with the worst of the first figure that misses its bar."""
    one = cell.measured
    if one.fallen:
        return one.cell.trials[one.fallen[0]]
    name = cell.reasons[0].figure
    values = [numbers[name] for numbers in one.trials]
    worst = max(values) if FIGURES[name].lower_is_better else min(values)
    return one.cell.trials[values.index(worst)]


def file_name(cell: str) -> str:
    """A cell's name in letters that every file system has."""
    signed = cell.replace("+", "plus ").replace("-", "minus ")
    return re.sub(r"[^a-z0-9.]+", "_", signed.lower()).strip("_")
