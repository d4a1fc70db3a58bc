"""Measure cells: run trials in parallel processes and collect their numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.batch import ClipPool
from pipeline.validation.cells import Cell
from pipeline.validation.deployed import Deployed
from pipeline.validation.figures import FIGURES, Numbers, numbers_of
from pipeline.validation.trial import Trial
from pipeline.validation.walk import Branches, Worlds, prefix_of

CHUNK = 32
"""Trials per process call."""


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A cell with the numbers of its trials, in order."""

    cell: Cell
    trials: tuple[Numbers, ...]

    @property
    def fallen(self) -> tuple[int, ...]:
        """Indices of the trials that fell."""
        return tuple(index for index, numbers in enumerate(self.trials) if numbers["fell"])

    def values(self, name: str) -> list[float]:
        """Values of a figure over the trials that have it."""
        return [numbers[name] for numbers in self.trials if name in numbers]

    def figure(self, name: str) -> float | None:
        """The cell's figure: count or share of all trials, or the worst trial; None if all trials fell."""
        if name == "falls":
            return float(len(self.fallen))
        if name == "survival":
            return 1.0 - len(self.fallen) / len(self.trials)
        values = self.values(name)
        if not values:
            return None
        return max(values) if FIGURES[name].lower_is_better else min(values)

    def spread(self, name: str) -> dict[str, float]:
        """Mean, standard deviation, minimum and maximum of a figure over the trials that have it."""
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
    """Run all trials of all cells. The numbers do not depend on the distribution over processes."""
    jobs = [(number, trial) for number, cell in enumerate(cells) for trial in cell.trials]
    # keep trials that share a prefix together: models are compiled and prefixes simulated once per process
    jobs.sort(key=lambda job: prefix_of(job[1]))
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
    """Numbers of each trial, computed in this process."""
    branches = Branches(Worlds(one))
    return [numbers_of(branches.walk(trial), trial, one.envelope) for trial in trials]
