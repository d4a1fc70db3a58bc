"""Resample messages to a regular time grid and write a Parquet file per trial, in bounded memory.

Messages are sorted and duplicates removed; gaps are marked and trials split.

Grid times are multiples of the period since 1970, so that a log without its beginning has the same samples.
"""

import itertools
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Int

from pipeline.hardware_logs.columns import HELD, LINEAR, PREVIOUS, Columns, HeldTopic, joined, taken
from pipeline.hardware_logs.log_report import TimeSettings
from pipeline.hardware_logs.robot_log import OperatorEvent
from pipeline.hardware_logs.trial import Gap, TrialWriter

LOST = "damage in the log"
SILENT = "no messages"


@dataclass(frozen=True, kw_only=True)
class Block:
    """n consecutive samples: all columns except the command."""

    grid_ns: Int[np.ndarray, " n"]
    columns: Columns


@dataclass
class Stretched:
    """Data of a trial in progress."""

    start_ns: int
    gaps: list[Gap] = field(default_factory=list)
    samples: int = 0
    messages: int = 0

    def message_hz(self, rate_hz: float) -> float:
        """Rate of `/low_state` messages [Hz], without damaged parts."""
        lost_s = sum(gap.stop_s - gap.start_s for gap in self.gaps if gap.reason == LOST)
        return self.messages / max(self.samples / rate_hz - lost_s, 1.0 / rate_hz)


class Regular:
    """Resampler: takes messages and returns blocks; a `Stretched` after its blocks ends a trial."""

    def __init__(self, settings: TimeSettings, joints: int):
        self.settings = settings
        self.duplicates, self.late = 0, 0
        self.trial: Stretched | None = None
        self._bridge, self._split = round(settings.bridge_s * 1e9), round(settings.split_s * 1e9)
        self._blank = _blank(joints)
        self._restart()

    def _restart(self) -> None:
        self._waiting: list[tuple[np.ndarray, Columns]] = []
        self._last: tuple[np.ndarray, Columns] | None = None
        self._held = {topic: HeldTopic() for topic in HELD}
        self._losses: list[int] = []
        self._next_ns = 0
        self._newest_ns: int | None = None

    def add(self, time_ns: Int[np.ndarray, " m"], columns: Columns) -> None:
        """Add messages of `/low_state`, in file order."""
        if len(time_ns):
            self._waiting.append((time_ns, columns))
            self._note(time_ns)

    def hold(self, topic: str, time_ns: Int[np.ndarray, " m"], columns: Columns) -> None:
        """Add messages of another topic."""
        if len(time_ns):
            self._held[topic].add(time_ns, columns)
            self._note(time_ns)

    def _note(self, time_ns: np.ndarray) -> None:
        newest = int(time_ns.max())
        self._newest_ns = newest if self._newest_ns is None else max(newest, self._newest_ns)

    def lose(self) -> None:
        """Mark a possible loss of messages: held values become unknown."""
        if self._newest_ns is not None:
            self._losses.append(self._newest_ns)
            for topic in self._held.values():
                topic.forget(self._newest_ns)  # messages with the same timestamp may be lost as well

    def ready(self) -> list[Block | Stretched]:
        """Blocks that no later message can precede, and trials that ended."""
        if self._newest_ns is None:
            return []
        return self._until(self._newest_ns - round(self.settings.disorder_s * 1e9))

    def finish(self) -> list[Block | Stretched]:
        """All remaining blocks, and the trial's end."""
        if self._newest_ns is None:
            return []
        found = self._until(self._newest_ns)
        if self.trial is not None:
            found.append(self.trial)
        self.trial = None
        self._restart()
        return found

    def _until(self, limit_ns: int) -> list[Block | Stretched]:
        if not self._waiting:
            return []
        times = np.concatenate([each for each, _ in self._waiting])
        columns = joined([each for _, each in self._waiting])
        old = times <= limit_ns
        self._waiting = [] if old.all() else [(times[~old], taken(columns, ~old))]
        times, columns = self._in_order(times[old], taken(columns, old))
        if not len(times):
            return []
        if self._last is not None:
            times = np.concatenate([self._last[0], times])
            columns = joined([self._last[1], columns])
        found: list[Block | Stretched] = []
        edges = [0, *(np.flatnonzero(np.diff(times) > self._split) + 1).tolist(), len(times)]
        for start, stop in itertools.pairwise(edges):
            if start and self.trial is not None:
                found.append(self.trial)
                self.trial = None
            known = self._last is not None and start == 0
            found += self._blocks(times[start:stop], taken(columns, slice(start, stop)), stop - start - known)
        self._last = (times[-1:], taken(columns, slice(-1, None)))
        self._losses = [loss for loss in self._losses if loss >= times[-1]]
        return found

    def _in_order(self, times: np.ndarray, columns: Columns) -> tuple[np.ndarray, Columns]:
        """Sort, remove duplicate timestamps and those before the last returned sample."""
        order = np.argsort(times, kind="stable")
        times = times[order]
        fresh = np.diff(times, prepend=-1) > 0
        self.duplicates += int((~fresh).sum())
        if self._last is not None:
            last = int(self._last[0][0])
            self.duplicates += int((fresh & (times == last)).sum())
            self.late += int((fresh & (times < last)).sum())
            fresh &= times > last
        return times[fresh], taken(columns, order[fresh])

    def _blocks(self, times: np.ndarray, columns: Columns, messages: int) -> list[Block | Stretched]:
        """Samples between the first and the last of the times that were not returned yet."""
        period = self.settings.period_ns
        if self.trial is None:
            self._next_ns = -(-int(times[0]) // period) * period
            self.trial = Stretched(start_ns=self._next_ns)
        self.trial.messages += messages
        self._note_gaps(times)
        grid = np.arange(self._next_ns, int(times[-1]) + 1, period, dtype=np.int64)
        if not len(grid):
            return []
        self._next_ns = int(grid[-1]) + period
        self.trial.samples += len(grid)
        found = self._resampled(grid, times, columns)
        for topic, names in HELD.items():
            found |= self._held[topic].at(grid, names, self._blank)
        return [Block(grid_ns=grid, columns=found)]

    def _note_gaps(self, times: np.ndarray) -> None:
        assert self.trial is not None
        for index in np.flatnonzero(self._apart(times)).tolist():
            start, stop = int(times[index]), int(times[index + 1])
            damaged = any(start <= loss < stop for loss in self._losses)
            start_s, stop_s = ((each - self.trial.start_ns) * 1e-9 for each in (start, stop))
            self.trial.gaps.append(Gap(start_s=start_s, stop_s=stop_s, reason=LOST if damaged else SILENT))

    def _apart(self, times: np.ndarray) -> np.ndarray:
        """Mask of consecutive messages with a gap: too far apart, or with lost messages between them."""
        steps = np.diff(times)
        apart = steps > self._bridge
        for loss in self._losses:
            before = int(np.searchsorted(times, loss, side="right")) - 1
            if 0 <= before < len(steps):
                apart[before] |= steps[before] > 1.5 * self.settings.period_ns
        return apart

    def _resampled(self, grid: np.ndarray, times: np.ndarray, columns: Columns) -> Columns:
        """Columns of `/low_state` at grid times, which must be within the messages' times."""
        right = np.searchsorted(times, grid, side="left")
        exact = times[right] == grid
        left = np.where(exact, right, right - 1)
        found = {name: columns[name][left] for name in PREVIOUS}
        apart = np.append(self._apart(times), False)[left] & ~exact
        found["temperature_c"][apart] = np.nan
        if exact.all():
            return found | {name: columns[name][right] for name in LINEAR}
        span = np.where(exact, 1, times[right] - times[left])
        weight = ((grid - times[left]) / span).astype(np.float32)[:, None]
        for name in LINEAR:
            before, step = columns[name][left], columns[name][right] - columns[name][left]
            if name == "rpy":
                step = _on_circle(step)
            values = before + weight * step
            found[name] = _on_circle(values) if name == "rpy" else values
            found[name][apart] = np.nan
        return found


def _on_circle(angles: np.ndarray) -> np.ndarray:
    """Wrap angles [rad] to -pi ... pi; angles in this range are not changed."""
    turns = np.where(np.abs(angles) > np.pi, np.round(angles / (2.0 * np.pi)), 0.0)
    return (angles - turns * 2.0 * np.pi).astype(angles.dtype)


def _blank(joints: int) -> Columns:
    """One row of the held columns with unknown values."""
    blank: Columns = {name: np.full((1, joints), np.nan, dtype=np.float32) for name in HELD["/joint_ctrl"]}
    blank["fall_state"] = np.full(1, -1, dtype=np.int64)
    for name in ("odometer", "sticks"):
        blank[name] = np.full((1, 3), np.nan, dtype=np.float32)
    return blank


ROWS = 4096
"""Samples per write."""


@dataclass
class OpenTrial:
    """A trial with written samples but without metadata."""

    writer: TrialWriter
    samples: int = 0
    made: Stretched | None = None
    events: tuple[OperatorEvent, ...] = ()
    command_source: str = "unknown"


class TrialFiles:
    """Writer of one log's trials, a context manager: files without metadata at its end are removed."""

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
        """Append samples to the open trial, or open one."""
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
        """Discard the samples of a trial that is too short."""
        self._waiting, self._rows = [], 0

    def close(self, made: Stretched, events: tuple[OperatorEvent, ...], command_source: str) -> None:
        """Close the open trial."""
        self._write()
        trial = self.trials[-1]
        trial.made, trial.events, trial.command_source = made, events, command_source

    def finish(self, heads: list[dict[str, Any]]) -> list[Path]:
        """Write each trial's metadata; return the files."""
        for trial, head in zip(self.trials, heads, strict=True):
            trial.writer.finish(head)
        return [trial.writer.path for trial in self.trials]
