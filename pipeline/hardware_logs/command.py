"""What the robot was asked to do at each sample, and what people did: schedule, sticks, buttons."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pipeline.hardware_logs.columns import pressed
from pipeline.hardware_logs.log_facts import StatedFacts
from pipeline.hardware_logs.messages import BUTTONS
from pipeline.hardware_logs.robot_log import OperatorEvent

Command = Float[np.ndarray, "n 3"]


class CommandSource:
    """The command of one log.

    Args:
        stated: what the log says of itself
        origin_ns: receipt of the log's first message, None where it is not known
        whole: nothing was lost where a statement may have been; a log that states nothing is then steered by its remote
    """

    def __init__(self, stated: StatedFacts, origin_ns: int | None, *, whole: bool):
        self.stated, self.origin_ns, self._whole = stated, origin_ns, whole
        facts = stated.facts
        self.kind = "schedule" if facts.command_source == "unknown" and facts.command else facts.command_source
        self._times = np.array([round(row[0] * 1e9) for row in facts.command], dtype=np.int64)
        rows = np.array([row[1:] for row in facts.command], dtype=np.float32).reshape(-1, 3)
        self._rows = np.concatenate([np.full((1, 3), np.nan, dtype=np.float32), rows])
        self._down = np.zeros(len(BUTTONS), dtype=bool)
        self._presses: list[tuple[int, str]] = []

    def at(self, grid_ns: Int[np.ndarray, " n"], sticks: Float[np.ndarray, "n 3"]) -> Command:
        """Commands at the samples.

        Args:
            sticks: lx, ly, rx, held; forward, left and turning left are negative
        """
        if self.kind == "schedule":
            if self.origin_ns is None:
                return np.full((len(grid_ns), 3), np.nan, dtype=np.float32)
            return self._rows[np.searchsorted(self._times, grid_ns - self.origin_ns, side="right")]
        if self.kind == "unknown" and self._whole and np.isfinite(sticks).any():
            self.kind = "remote"
        if self.kind == "remote":
            return -sticks[:, [1, 0, 2]] * np.array(self.stated.facts.command_scale, dtype=np.float32)
        return np.full((len(grid_ns), 3), np.nan, dtype=np.float32)

    def forget_origin(self) -> None:
        """The clock jumped: what was stated in seconds can't be placed any more."""
        self.origin_ns = None

    def note_buttons(self, time_ns: Int[np.ndarray, " m"], rows: np.ndarray) -> None:
        """Take messages of the remote: buttons that go down are events."""
        down = pressed(rows)
        before = np.concatenate([self._down[None], down[:-1]])
        for row, button in np.argwhere(down & ~before).tolist():
            self._presses.append((int(time_ns[row]), BUTTONS[button]))
        self._down = down[-1] if len(down) else self._down

    def events(self, start_ns: int, stop_ns: int) -> tuple[OperatorEvent, ...]:
        """Events of a trial in its time: what was stated until its end (also before its start), buttons within it."""
        found = [
            OperatorEvent(time_s=(each - start_ns) * 1e-9, kind=f"button {button}", source="remote")
            for each, button in self._presses
            if start_ns <= each <= stop_ns
        ]
        if self.origin_ns is not None:
            for event in self.stated.facts.events:
                time_s = event.time_s + (self.origin_ns - start_ns) * 1e-9
                if time_s <= (stop_ns - start_ns) * 1e-9:
                    found.append(OperatorEvent(time_s=time_s, kind=event.kind, source=event.source))
        return tuple(sorted(found, key=lambda event: (event.time_s, event.kind)))
