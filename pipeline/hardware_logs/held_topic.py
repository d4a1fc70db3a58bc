"""A topic whose last value is held: messages go in, values at given times come out."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from pipeline.hardware_logs.columns import Columns, joined, taken, unknown


class HeldTopic:
    """Times and columns that are not yet past, with the last that is."""

    def __init__(self) -> None:
        self._times: list[np.ndarray] = []
        self._columns: list[Columns] = []

    def add(self, time_ns: Int[np.ndarray, " m"], columns: Columns) -> None:
        if len(time_ns):
            self._times.append(time_ns)
            self._columns.append(columns)

    def forget(self, time_ns: int) -> None:
        """From this time on nothing is known until the next message: some may be lost."""
        if self._columns:
            nothing = {name: unknown(values) for name, values in self._columns[-1].items()}
            self.add(np.array([time_ns], dtype=np.int64), nothing)

    def at(self, grid_ns: Int[np.ndarray, " n"], names: tuple[str, ...], blank: Columns) -> Columns:
        """Values at ascending times; what is past is dropped.

        Args:
            blank: one row of each column that says nothing, for times before the first message
        """
        if not self._times:
            return {name: np.repeat(blank[name], len(grid_ns), axis=0) for name in names}
        times = np.concatenate(self._times)
        order = np.argsort(times, kind="stable")
        times, columns = times[order], taken(joined(self._columns), order)
        place = np.searchsorted(times, grid_ns, side="right")
        found = {name: np.concatenate([blank[name], columns[name]])[place] for name in names}
        first = max(int(place[-1]) - 1, 0) if len(place) else 0
        self._times, self._columns = [times[first:]], [taken(columns, slice(first, None))]
        return found
