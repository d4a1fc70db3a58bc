"""Checkpoints of arms, and means of their last ones, walked in plain MuJoCo on the host's cores during training."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
from collections.abc import Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.learning.checkpoint import load_checkpoint
from pipeline.learning.policy_file import mean_arrays, policy_arrays, write_policy
from pipeline.learning.robot_facts import RobotFacts
from pipeline.training.arms import write_json
from pipeline.training.checkpoint_sweep import cells_of, score
from pipeline.training.plain_walk import Figures, Walk, walked

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Of each process that walks: one a core, or they stand in each other's way."""


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A network that may be an arm's policy: that of a checkpoint, or the mean of several."""

    folder: Path
    """Of its arm."""
    checkpoints: tuple[Path, ...]

    @property
    def name(self) -> str:
        """As `000600` or `mean-000600-000700`."""
        numbers = [path.stem.split("_")[1] for path in self.checkpoints]
        return numbers[0] if len(numbers) == 1 else f"mean-{'-'.join(numbers)}"

    @property
    def policy(self) -> Path:
        return self.folder / "policies" / f"{self.name}.npz"

    def sweep(self, kind: str) -> Path:
        """Where its figures of a kind of sweep are."""
        return self.folder / "sweeps" / f"{kind}-{self.name}.json"

    def figures(self, kind: str) -> dict[str, Any] | None:
        """`cells` and `score`, where it was swept."""
        path = self.sweep(kind)
        return json.loads(path.read_text()) if path.is_file() else None

    def export(self, robot: RobotFacts) -> None:
        """Write its npz, where it isn't there."""
        if not self.policy.is_file():
            each = [policy_arrays(load_checkpoint(path, "cpu"), robot) for path in self.checkpoints]
            write_policy(self.policy, mean_arrays(each))


def candidates(folder: Path, checkpoints: Sequence[Path], first: int, done: bool) -> list[Candidate]:
    """The checkpoints of `first` and more iterations; of a run that is done, also the means of its last two to five.

    The last one is there whatever its iteration.
    """
    number = {path: int(path.stem.split("_")[1]) for path in checkpoints}
    taken = [path for path in checkpoints if number[path] >= first] or (list(checkpoints[-1:]) if done else [])
    found = [Candidate(folder=folder, checkpoints=(path,)) for path in taken]
    if done:
        found += [Candidate(folder=folder, checkpoints=tuple(taken[-n:])) for n in (2, 3, 4, 5) if n <= len(taken)]
    return found


class Sweeps:
    """A pool of processes that walk; what is asked twice is walked once."""

    def __init__(self, bundle: Path, robot: RobotFacts, workers: int):
        self._bundle, self._robot = bundle, robot
        os.environ |= dict.fromkeys(THREADS, "1")  # processes to be spawned inherit it; this one has read them already
        self._pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))
        self._open: dict[Path, tuple[Candidate, tuple[Walk, ...], list[Future]]] = {}

    def ask(self, candidate: Candidate, kind: str, walks: tuple[Walk, ...]) -> None:
        """Have a candidate swept, where it was not and is not."""
        path = candidate.sweep(kind)
        if path in self._open or path.is_file():
            return
        candidate.export(self._robot)
        digest = hashlib.sha256(candidate.policy.read_bytes()).hexdigest()
        jobs = [self._pool.submit(walked, self._bundle, candidate.policy, digest, walk) for walk in walks]
        self._open[path] = (candidate, walks, jobs)

    def gather(self) -> int:
        """Write down the sweeps whose walks are all done; how many are still walked."""
        for path, (candidate, walks, jobs) in list(self._open.items()):
            if all(job.done() for job in jobs):
                cells = cells_of(walks, [_figures(job) for job in jobs])
                write_json(path, {"candidate": candidate.name, "cells": cells, **score(cells)})
                del self._open[path]
        return len(self._open)

    def close(self) -> None:
        """End the processes; walks that have not begun are dropped."""
        self._pool.shutdown(wait=True, cancel_futures=True)


def _figures(job: Future) -> Figures:
    """Of a walk; one that broke off, for whatever reason, counts as a fall: training goes on."""
    error = job.exception()
    if error is None:
        return job.result()
    print(f"a walk broke off: {error}", flush=True)
    return {"fell": 1.0}


def best(found: Sequence[Candidate], kind: str) -> Candidate | None:
    """The candidate of the lowest score among those that were swept; the later of two alike."""
    scored = [(at, each, each.figures(kind)) for at, each in enumerate(found)]
    known = [(figures["score"], -at, each) for at, each, figures in scored if figures is not None]
    return min(known, key=lambda known: known[:2])[2] if known else None
