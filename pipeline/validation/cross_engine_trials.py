"""Failures in an engine, written as logs of a virtual robot."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.deployment import digest
from pipeline.hardware_logs.missed_bars import MissedBar, note_of
from pipeline.hardware_logs.robot_log import LogFacts, OperatorEvent, RobotLog
from pipeline.hardware_logs.write import write_mcap
from pipeline.validation.cross_engine import HELD, CellResult, CrossEngineResult, errors_of, off_command
from pipeline.validation.cross_engine_walk import Cell, CrossEngineSettings, walk
from pipeline.validation.deployed import Deployed
from pipeline.validation.failed_trials import CELL_NOTE, LONGEST_NOTE, file_name, largest_error
from pipeline.virtual_robot.record import record


def write_failures(
    deployed: Deployed, found: CrossEngineResult, settings: CrossEngineSettings, folder: Path
) -> tuple[Path, ...]:
    """Write one MCAP file per required cell and engine with a fall or a missed command; return the paths.

    Equal results give equal bytes. A mere disagreement of engines gives no log, as it is no trial of one robot.
    """
    written = []
    for cell in found.failed_cells:
        for engine, seed in first_failures(cell, settings.cells[cell.name]):
            path = folder / f"{file_name(cell.name)}_{engine}.mcap"
            write_mcap(path, failure_log(deployed, cell, engine, seed, settings))
            written.append(path)
    return tuple(written)


def first_failures(cell: CellResult, settings: Cell) -> tuple[tuple[str, int], ...]:
    """Engine and seed of the first fall in each engine of `HELD`; without a fall, of the first walk off its command."""
    found = []
    for engine in HELD:
        walks = cell.figures.get(engine, ())
        fallen = [seed for seed, one in enumerate(walks) if one.fell]
        off = [seed for seed, one in enumerate(walks) if not one.fell and any(off_command(settings, cell.bars, one))]
        found += [(engine, seed) for seed in [*fallen, *off][:1]]
    return tuple(found)


def missed_by(cell: CellResult, engine: str, seed: int, settings: Cell) -> tuple[MissedBar, ...]:
    """The bars that a walk missed: its engine's falls after a fall, else the velocity errors."""
    one, bars = cell.figures[engine][seed], cell.bars.bars
    if one.fell_s is not None:
        fallen = float(sum(each.fell for each in cell.figures[engine]))
        missed: dict[str, dict[str, Any]] = {"falls": {"got": fallen, "from_s": one.fell_s, "until_s": one.fell_s}}
    else:
        span = {"from_s": settings.seconds - settings.measured_s, "until_s": settings.seconds}
        missed = {
            name: {"got": error, **span, **largest_error(name, settings.command, one.velocity)}
            for name, error in errors_of(settings, one).items()
        }
    found = []
    for name, each in missed.items():
        if name in bars and not bars[name].holds(each["got"]):
            with suppress(ValueError):  # implausible values are rejected by MissedBar
                found.append(MissedBar(cell=cell.name, figure=name, asked=bars[name].at_most or 0.0, **each))
    return tuple(found)


def failure_log(
    deployed: Deployed, cell: CellResult, engine: str, seed: int, settings: CrossEngineSettings
) -> RobotLog:
    """Repeat the walk to its end, even after a fall, and return it as a log."""
    definition = settings.cells[cell.name]
    rollout = walk(deployed, engine, definition, seed, settings.simulation, stop_on_fall=False)
    pushes = () if definition.push is None else (OperatorEvent(time_s=definition.push.start_s, kind="pushed"),)
    reasons = "; ".join(cell.reasons)[:LONGEST_NOTE]
    notes = {CELL_NOTE: cell.name, "engine": engine, "seed": str(seed), "reasons": reasons}
    notes |= note_of(missed_by(cell, engine, seed, definition))
    facts = LogFacts(robot=deployed.robot.name, policy_digest=digest(deployed.policy), events=pushes, notes=notes)
    return record(rollout, deployed.task.kp, deployed.task.kd, facts, np.random.default_rng(seed))
