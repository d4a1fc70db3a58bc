"""Cells measured: trials in parallel processes, numbers gathered by cell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.batch import ClipPool
from pipeline.validation.cells import Cell
from pipeline.validation.deployed import Deployed
from pipeline.validation.figures import FIGURES, Numbers, numbers_of
from pipeline.validation.trial import Trial
from pipeline.validation.walk import Branches, Worlds, way_of

CHUNK = 32
"""Trials that go to a process at once."""


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A cell with what its trials gave, in their order."""

    cell: Cell
    trials: tuple[Numbers, ...]

    @property
    def fallen(self) -> tuple[int, ...]:
        """Which trials fell."""
        return tuple(index for index, numbers in enumerate(self.trials) if numbers["fell"])

    def values(self, name: str) -> list[float]:
        """A figure of each trial that has it."""
        return [numbers[name] for numbers in self.trials if name in numbers]

    def figure(self, name: str) -> float | None:
        """The figure of the cell: a count or share of all trials, or the worst of its trials; None where all fell."""
        if name == "falls":
            return float(len(self.fallen))
        if name == "survival":
            return 1.0 - len(self.fallen) / len(self.trials)
        values = self.values(name)
        if not values:
            return None
        return max(values) if FIGURES[name].lower_is_better else min(values)

    def spread(self, name: str) -> dict[str, float]:
        """Mean, standard deviation, least and most of a trial's number over the trials that have it."""
        values = self.values(name)
        if not values:
            return {}
        return {
            "mean": float(np.mean(values)),
            "std": float(np.std(values)),
            "min": min(values),
            "max": max(values),
        }


def measure(one: Deployed, cells: Sequence[Cell], pool: ClipPool | None = None) -> tuple[Measured, ...]:
    """All trials of all cells. The numbers do not depend on how the trials are spread."""
    jobs = [(number, trial) for number, cell in enumerate(cells) for trial in cell.trials]
    # what trials share comes one after the other: worlds are compiled and ways to a push walked once in a process
    jobs.sort(key=lambda job: way_of(job[1]))
    chunks = [jobs[first : first + CHUNK] for first in range(0, len(jobs), CHUNK)]
    found: dict[tuple[int, int], Numbers] = {}
    calls = [(one, tuple(trial for _, trial in chunk)) for chunk in chunks]
    for chunk, numbers in zip(chunks, (pool or ClipPool()).map(measure_trials, calls), strict=True):
        for (number, trial), each in zip(chunk, numbers, strict=True):
            found[number, id(trial)] = each
    return tuple(
        Measured(cell=cell, trials=tuple(found[number, id(trial)] for trial in cell.trials))
        for number, cell in enumerate(cells)
    )


def measure_trials(one: Deployed, trials: Sequence[Trial]) -> list[Numbers]:
    """Numbers of each trial, in this process."""
    branches = Branches(Worlds(one))
    return [numbers_of(branches.walk(trial), trial, one.envelope) for trial in trials]
