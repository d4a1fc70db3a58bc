"""A folder that somebody chose for the logs of failed cells: which files there are of an earlier verdict."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from pipeline.deployment import digest
from pipeline.errors import FileError
from pipeline.hardware_logs.log_facts import stated_facts
from pipeline.hardware_logs.log_report import Bounds, LogError, LogReport
from pipeline.hardware_logs.mcap_reader import McapReader
from pipeline.hardware_logs.robot_log import METADATA, LogFacts
from pipeline.validation.cells import Cell
from pipeline.validation.deployed import Deployed
from pipeline.validation.failed_trials import CELL_NOTE, log_path


def refuse_foreign(folder: Path, cells: Iterable[Cell], one: Deployed) -> None:
    """Raises FileError where a log of one of these cells would take the place of a file that is not of this policy's
    validation, and where the folder is none."""
    if folder.exists() and not folder.is_dir():
        raise FileError(folder, "it is no folder.", "Name a folder for the logs of what fails.")
    for path in (log_path(folder, cell.name) for cell in cells):
        if path.exists() and not _is_of(path, one):
            problem = "it is no log of this policy's validation, and a cell that fails would be written there."
            raise FileError(path, problem, "Name another folder for the logs of what fails.")


def remove_earlier(folder: Path, one: Deployed, kept: Iterable[Path]) -> tuple[Path, ...]:
    """Remove the logs in a folder that earlier verdicts of this policy on this robot wrote there, but for those of this
    one; feedback would go on learning from cells that pass now. What the metadata of a file does not show to be such a
    log stays. Returns what is gone."""
    gone = [path for path in sorted(set(folder.glob("*.mcap")) - set(kept)) if _is_of(path, one)]
    for path in gone:
        path.unlink()
    return tuple(gone)


def _is_of(path: Path, one: Deployed) -> bool:
    """Whether a file is what `write_failed_trials` writes of this policy on this robot. One that somebody gave another
    name is not."""
    facts = _facts_of(path)
    if facts is None or not facts.simulated:
        return False
    cell = facts.notes.get(CELL_NOTE, "")
    mine = facts.robot == one.robot.name and facts.policy_digest == digest(one.policy)
    return mine and "engine" not in facts.notes and path == log_path(path.parent, cell)


def _facts_of(path: Path) -> LogFacts | None:
    """What a log says of itself before its first messages; None of what is no log."""
    reader = McapReader(path, LogReport(path=path), Bounds())
    with suppress(LogError, OSError):
        for _ in reader.read():
            break
    stated = reader.metadata.get(METADATA)
    return stated_facts(stated, None).facts if stated else None
