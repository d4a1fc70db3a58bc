"""Blocks of samples into Parquet files, one a trial, in flat memory."""

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.hardware_logs.columns import Columns, joined
from pipeline.hardware_logs.regular import Stretched
from pipeline.hardware_logs.robot_log import OperatorEvent
from pipeline.hardware_logs.trial import TrialWriter

ROWS = 4096
"""Samples that are written at a time."""


@dataclass
class OpenTrial:
    """A trial whose samples are written and whose head is not."""

    writer: TrialWriter
    samples: int = 0
    made: Stretched | None = None
    events: tuple[OperatorEvent, ...] = ()
    command_source: str = "unknown"


class TrialFiles:
    """Writes the trials of one log below a folder. Use it as a context: what has no head at its end is taken away."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.trials: list[OpenTrial] = []
        self._stack = ExitStack()
        self._waiting: list[Columns] = []
        self._rows = 0

    def __enter__(self) -> "TrialFiles":
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def add(self, columns: Columns) -> None:
        """Append samples to the trial that is open, or open one."""
        self._waiting.append(columns)
        self._rows += len(columns["time_s"])
        if self._rows >= ROWS:
            self._write()

    def _write(self) -> None:
        if not self._waiting:
            return
        if not self.trials or self.trials[-1].made is not None:
            path = self.folder / f"{len(self.trials) + 1}.parquet"
            self.trials.append(OpenTrial(writer=self._stack.enter_context(TrialWriter(path))))
        self.trials[-1].writer.add(joined(self._waiting))
        self.trials[-1].samples += self._rows
        self._waiting, self._rows = [], 0

    def drop(self) -> None:
        """Forget the samples of a trial that is too short."""
        self._waiting, self._rows = [], 0

    def close(self, made: Stretched, events: tuple[OperatorEvent, ...], command_source: str) -> None:
        """The trial that is open has no more samples."""
        self._write()
        trial = self.trials[-1]
        trial.made, trial.events, trial.command_source = made, events, command_source

    def finish(self, heads: list[dict[str, Any]]) -> list[Path]:
        """Give each trial its head; the files."""
        for trial, head in zip(self.trials, heads, strict=True):
            trial.writer.finish(head)
        return [trial.writer.path for trial in self.trials]
