"""Logs of earlier verdicts in a folder for logs of failed cells: recognize, protect, remove."""

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
    """Check that no log of these cells would overwrite a foreign file.

    Raises FileError if a target exists and is not a log of this policy's validation, or if `folder` is not a folder.
    """
    if folder.exists() and not folder.is_dir():
        raise FileError(folder, "it is no folder.", "Name a folder for the logs of what fails.")
    for path in (log_path(folder, cell.name) for cell in cells):
        if path.exists() and not _is_of(path, one):
            problem = "it is no log of this policy's validation, and a cell that fails would be written there."
            raise FileError(path, problem, "Name another folder for the logs of what fails.")


def remove_earlier(folder: Path, one: Deployed, kept: Iterable[Path]) -> tuple[Path, ...]:
    """Remove the logs of earlier verdicts on this policy and robot, except `kept`; return the removed paths.

    Otherwise feedback would keep learning from cells that pass now. Files whose metadata does not identify them as such
    a log are kept.
    """
    gone = [path for path in sorted(set(folder.glob("*.mcap")) - set(kept)) if _is_of(path, one)]
    for path in gone:
        path.unlink()
    return tuple(gone)


def _is_of(path: Path, one: Deployed) -> bool:
    """Whether a file was written by `write_failed_trials` for this policy and robot, under its own name."""
    facts = _facts_of(path)
    if facts is None or not facts.simulated:
        return False
    cell = facts.notes.get(CELL_NOTE, "")
    mine = facts.robot == one.robot.name and facts.policy_digest == digest(one.policy)
    return mine and "engine" not in facts.notes and path == log_path(path.parent, cell)


def _facts_of(path: Path) -> LogFacts | None:
    """The facts in a log's metadata; None if the file is not a log."""
    reader = McapReader(path, LogReport(path=path), Bounds())
    with suppress(LogError, OSError):
        for _ in reader.read():
            break
    stated = reader.metadata.get(METADATA)
    return stated_facts(stated, None).facts if stated else None
