"""What a policy failed at in an engine, as the log that a robot would have written of it."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.deployment import digest
from pipeline.hardware_logs.missed_bars import MissedBar, note_of
from pipeline.hardware_logs.robot_log import LogFacts, OperatorEvent, RobotLog
from pipeline.hardware_logs.write import write_mcap
from pipeline.validation.cross_engine import HELD, CellResult, CrossEngineResult, errors_of, off_command
from pipeline.validation.cross_engine_settings import Cell, CrossEngineSettings
from pipeline.validation.cross_engine_walk import walk
from pipeline.validation.deployed import Deployed
from pipeline.validation.failed_trials import CELL_NOTE, LONGEST_NOTE, file_name, off_most
from pipeline.virtual_robot.record import record


def write_failures(
    deployed: Deployed, found: CrossEngineResult, settings: CrossEngineSettings, folder: Path
) -> tuple[Path, ...]:
    """One MCAP file for each required cell and engine in which the robot fell or missed its command; equal results give
    equal bytes. Where engines only disagree there is no log: that is no trial of one robot."""
    written = []
    for cell in found.failed_cells:
        for engine, seed in first_failures(cell, settings.cells[cell.name]):
            path = folder / f"{file_name(cell.name)}_{engine}.mcap"
            write_mcap(path, failure_log(deployed, cell, engine, seed, settings))
            written.append(path)
    return tuple(written)


def first_failures(cell: CellResult, said: Cell) -> tuple[tuple[str, int], ...]:
    """Engine and seed of the first fall in each engine that is held to the bars; where none fell, of the first walk
    that is too far from its command."""
    found = []
    for engine in HELD:
        walks = cell.figures.get(engine, ())
        fallen = [seed for seed, one in enumerate(walks) if one.fell]
        off = [seed for seed, one in enumerate(walks) if not one.fell and any(off_command(said, cell.bars, one))]
        found += [(engine, seed) for seed in [*fallen, *off][:1]]
    return tuple(found)


def missed_by(cell: CellResult, engine: str, seed: int, said: Cell) -> tuple[MissedBar, ...]:
    """The bars that a walk missed: of a fall its engine's falls, else the velocities that are off."""
    one, bars = cell.figures[engine][seed], cell.bars.bars
    if one.fell_s is not None:
        fallen = float(sum(each.fell for each in cell.figures[engine]))
        seen: dict[str, dict[str, Any]] = {"falls": {"got": fallen, "from_s": one.fell_s, "until_s": one.fell_s}}
    else:
        end_s = sum(segment.seconds for segment in said.segments)
        reached = one.forward_m_s, one.lateral_m_s, one.yaw_rate_rad_s
        span = {"from_s": end_s - said.measured_s, "until_s": end_s}
        errors = errors_of(said, one)
        seen = {
            name: {"got": error, **span, **off_most(name, said.segments[-1].command, reached)}
            for name, error in errors.items()
        }
    found = []
    for name, each in seen.items():
        if name in bars and not bars[name].holds(each["got"]):
            with suppress(ValueError):  # beyond what a reader of logs believes
                found.append(MissedBar(cell=cell.name, figure=name, asked=bars[name].at_most or 0.0, **each))
    return tuple(found)


def failure_log(
    deployed: Deployed, cell: CellResult, engine: str, seed: int, settings: CrossEngineSettings
) -> RobotLog:
    """The walk again, to its end though it falls, as a log."""
    said = settings.cells[cell.name]
    rollout = walk(deployed, engine, said, seed, settings.simulation, stop_on_fall=False)
    pushes = () if said.push is None else (OperatorEvent(time_s=said.push.start_s, kind="pushed"),)
    reasons = "; ".join(cell.reasons)[:LONGEST_NOTE]
    notes = {CELL_NOTE: cell.name, "engine": engine, "seed": str(seed), "reasons": reasons}
    notes |= note_of(missed_by(cell, engine, seed, said))
    facts = LogFacts(robot=deployed.robot.name, policy_digest=digest(deployed.policy), events=pushes, notes=notes)
    return record(rollout, deployed.task.kp, deployed.task.kd, facts, np.random.default_rng(seed))
