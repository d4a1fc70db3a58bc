"""The error of a robot folder: every fault found, each with its file, line and what to do."""

from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import PipelineError, shortened


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One fault of a robot folder."""

    path: Path
    problem: str
    """The problem, as a sentence without the file's name."""
    do: str
    """The remedy."""
    line: int | None = None
    """Line of the file, counted from 1."""

    def __str__(self) -> str:
        where = f"{self.path}, line {self.line}" if self.line is not None else f"{self.path}"
        return f"{where}: {shortened(self.problem)} {self.do}"


class RobotError(PipelineError):
    """An unusable robot folder; the text has one line per fault."""

    def __init__(self, faults: list[Fault]):
        self.faults = tuple(faults)
        super().__init__("\n".join(str(fault) for fault in faults))


def refuse(faults: list[Fault]) -> None:
    """Raise RobotError if there is any fault."""
    if faults:
        raise RobotError(faults)
