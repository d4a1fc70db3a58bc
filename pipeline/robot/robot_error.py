"""The error of a robot folder: every fault found, each with its file, line and what to do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import PipelineError


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One thing that is wrong with a robot folder."""

    path: Path
    problem: str
    """What is wrong, as a sentence without the file's name."""
    do: str
    """What the user can do about it."""
    line: int | None = None
    """Line of the file, counted from 1."""

    def __str__(self) -> str:
        where = f"{self.path}, line {self.line}" if self.line is not None else f"{self.path}"
        return f"{where}: {self.problem} {self.do}"


class RobotError(PipelineError):
    """A robot folder that cannot be used; the text has one line for each fault."""

    def __init__(self, faults: list[Fault]):
        self.faults = tuple(faults)
        super().__init__("\n".join(str(fault) for fault in faults))


def refuse(faults: list[Fault]) -> None:
    """Raise RobotError if there is any fault."""
    if faults:
        raise RobotError(faults)
