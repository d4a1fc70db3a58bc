"""Write one trial of each failed cell as a log of a virtual robot."""

import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.deployment import digest
from pipeline.errors import FileError
from pipeline.hardware_logs.log_facts import stated_facts
from pipeline.hardware_logs.log_report import LogError, LogReport
from pipeline.hardware_logs.mcap_reader import McapReader
from pipeline.hardware_logs.missed_bars import KNOWN, MissedBar, note_of
from pipeline.hardware_logs.robot_log import METADATA, LogFacts, OperatorEvent, RobotLog
from pipeline.hardware_logs.write import write_mcap
from pipeline.simulation.record import Rollout
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.cells import Cell
from pipeline.validation.deployed import Deployed
from pipeline.validation.figures import FIGURES, Numbers, most_saturated
from pipeline.validation.trial import Trial
from pipeline.validation.verdict import CellVerdict, Verdict
from pipeline.validation.walk import Worlds, walk
from pipeline.virtual_robot.record import record

LONGEST_NOTE = 400
"""Most characters of the reasons in a log."""
CELL_NOTE = "validation cell"
"""Key of a log's note with the name of its cell."""
OF_FALLS = ("falls", "survival")
"""Figures over all trials of a cell."""
AXES: tuple[str, ...] = ("forward", "lateral", "yaw")


def write_failed_trials(one: Deployed, verdict: Verdict, folder: Path) -> tuple[Path, ...]:
    """Write one MCAP file per failed cell and return the paths; equal verdicts give equal bytes."""
    worlds, written = Worlds(one), []
    for cell in verdict.failed_cells:
        path = log_path(folder, cell.measured.cell.name)
        _, log = failed_trial(worlds, cell)
        write_mcap(path, log)
        written.append(path)
    return tuple(written)


def failed_trial(worlds: Worlds, cell: CellVerdict) -> tuple[Rollout, RobotLog]:
    """The worst trial of a cell, repeated to its end even after a fall, with its log."""
    one, (trial, _) = worlds.one, worst_trial(cell)
    rollout = walk(worlds, trial, stop_on_fall=False)
    reasons = "; ".join(map(str, cell.reasons))
    notes = {CELL_NOTE: cell.measured.cell.name, "reasons": reasons[:LONGEST_NOTE], "seed": str(trial.seed)}
    facts = LogFacts(
        robot=one.robot.name,
        policy_digest=digest(one.policy),
        events=tuple(OperatorEvent(time_s=event.start_s, kind="pushed") for event in trial.events),
        notes=notes | note_of(missed_by(cell, rollout, one.envelope)),
    )
    gains = trial.conditions.gain_factor
    rng = np.random.default_rng(trial.seed)
    return rollout, record(rollout, gains * one.task.kp, gains * one.task.kd, facts, rng)


def worst_trial(cell: CellVerdict) -> tuple[Trial, Numbers]:
    """The first trial that fell, else the worst in the first figure that misses its bar; and its numbers."""
    place = _worst(cell)
    return cell.measured.cell.trials[place], cell.measured.trials[place]


def _worst(cell: CellVerdict) -> int:
    one = cell.measured
    if one.fallen:
        return one.fallen[0]
    name = cell.reasons[0].figure
    values = [numbers[name] for numbers in one.trials]
    worst = max(values) if FIGURES[name].lower_is_better else min(values)
    return values.index(worst)


def missed_by(cell: CellVerdict, rollout: Rollout, envelope: TorqueEnvelope) -> tuple[MissedBar, ...]:
    """The bars that a cell's worst trial missed itself, in the order of the verdict's reasons.

    Bars that only other trials missed are in the reasons only; implausible values are left out.
    """
    trial, numbers = worst_trial(cell)
    found = []
    for reason in cell.reasons:
        bar = cell.bars.bars[reason.figure]
        measured: dict[str, Any] = {}
        if numbers["fell"]:
            if reason.figure in OF_FALLS:
                measured = {"got": reason.got, "from_s": numbers["fell_s"], "until_s": numbers["fell_s"]}
        elif reason.figure not in OF_FALLS and not bar.holds(numbers[reason.figure]):
            measured = _measured(reason.figure, numbers, trial, rollout, envelope)
        if measured:
            asked = bar.at_most if bar.at_most is not None else bar.at_least
            with suppress(ValueError):
                found.append(MissedBar(cell=reason.cell, figure=reason.figure, asked=asked or 0.0, **measured))
    return tuple(found)


def _measured(name: str, numbers: Numbers, trial: Trial, rollout: Rollout, envelope: TorqueEnvelope) -> dict[str, Any]:
    """A trial's figure with its origin: the axis with the largest velocity error, the saturated joint."""
    measured: dict[str, Any] = {"got": numbers[name], "from_s": trial.measure_s, "until_s": trial.seconds}
    if name == "saturation":
        measured["joint"] = most_saturated(rollout, trial.measure_s, envelope)
    if KNOWN[name].axes:
        reached = numbers["forward"], numbers["lateral"], numbers["yaw_rate"]
        measured |= largest_error(name, trial.command.last.goal, reached)
    return measured


def largest_error(figure: str, goal: tuple[float, float, float], reached: tuple[float, float, float]) -> dict[str, Any]:
    """The axis with the largest velocity error, with its commanded and achieved velocity."""
    commanded, achieved = dict(zip(AXES, goal, strict=True)), dict(zip(AXES, reached, strict=True))
    axis = max(KNOWN[figure].axes, key=lambda each: abs(achieved[each] - commanded[each]))
    return {"axis": axis, "commanded": commanded[axis], "achieved": achieved[axis]}


def log_path(folder: Path, cell: str) -> Path:
    """Path of a failed cell's log."""
    return folder / f"{file_name(cell)}.mcap"


def file_name(cell: str) -> str:
    """A cell's name as a portable file name."""
    signed = cell.replace("+", "plus ").replace("-", "minus ")
    return re.sub(r"[^a-z0-9.]+", "_", signed.lower()).strip("_")


def refuse_foreign(folder: Path, cells: Iterable[Cell], one: Deployed) -> None:
    """Check that no log of these cells would overwrite a foreign file.

    Raises FileError if a target exists and is not a log of this policy's validation, or if `folder` is not a folder.
    """
    if folder.exists() and not folder.is_dir():
        raise FileError(folder, "it is no folder.", "Name a folder for the logs of what fails.")
    for path in (log_path(folder, cell.name) for cell in cells):
        if path.exists() and not _is_of(path, one):
            problem = "it is no log of this policy's validation, and a cell that fails would be written there."
            raise FileError(path, problem, "Name another folder for the logs of what fails.")


def remove_earlier(
    folder: Path, one: Deployed, kept: Iterable[Path], tried: Iterable[Cell] | None = None
) -> tuple[Path, ...]:
    """Remove the logs of earlier verdicts on this policy and robot, except `kept`; return the removed paths.

    Otherwise feedback would keep learning from cells that pass now. Of a verdict on some cells (`tried`) the logs of
    others stay, and so do files whose metadata does not identify them as such a log.
    """
    known = None if tried is None else {log_path(folder, cell.name) for cell in tried}
    paths = [path for path in sorted(set(folder.glob("*.mcap")) - set(kept)) if known is None or path in known]
    gone = [path for path in paths if _is_of(path, one)]
    for path in gone:
        path.unlink()
    return tuple(gone)


def _is_of(path: Path, one: Deployed) -> bool:
    """Whether a file was written by `write_failed_trials` for this policy and robot, under its own name."""
    reader = McapReader(path, LogReport(path=path))
    with suppress(LogError, OSError):
        for _ in reader.read():
            break
    stated = reader.metadata.get(METADATA)
    facts = stated_facts(stated, None).facts if stated else None
    if facts is None or not facts.simulated:
        return False
    cell = facts.notes.get(CELL_NOTE, "")
    mine = facts.robot == one.robot.name and facts.policy_digest == digest(one.policy)
    return mine and "engine" not in facts.notes and path == log_path(path.parent, cell)
