"""Parallel processes for clips, through joblib: the backend is a setting, so a cluster is one too."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import joblib

WATCH_EVERY_S = 1.0
"""How often a worker process looks whether its parent is there."""


@dataclass(frozen=True, kw_only=True)
class ClipPool:
    """How clips are spread over processes.

    `backend` is any joblib backend: `loky` (processes on this machine), `sequential`, or one that a
    package registers (`dask`, `ray`); `workers` 0 means one for each core that this process may use, as its
    affinity and its container's share have it.
    """

    backend: str = "loky"
    workers: int = 0

    def map(self, function: Callable[..., Any], calls: Sequence[tuple]) -> Iterator[Any]:
        """Results of `function(*call)` for each call, in order, as they come.

        A single call, or a pool of one worker, runs in this process. Processes on this machine end with this one,
        however it ends.
        """
        workers = min(self.workers or joblib.cpu_count(), len(calls))
        if workers <= 1 or self.backend == "sequential":
            yield from (function(*call) for call in calls)
            return
        with joblib.parallel_config(backend=self.backend, n_jobs=workers):
            parallel = joblib.Parallel(return_as="generator", pre_dispatch="2*n_jobs")
            work = partial(_ending_with, os.getpid(), function) if self.backend == "loky" else function
            yield from parallel(joblib.delayed(work)(*call) for call in calls)


def _ending_with(parent: int, function: Callable[..., Any], *call: Any) -> Any:
    """`function(*call)` in a worker process that ends when its parent does."""
    if not _WATCHED and os.getppid() == parent:
        _WATCHED.append(parent)
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()
    return function(*call)


_WATCHED: list[int] = []
"""The parent that this process is watching, once it does."""


def _watch(parent: int) -> None:
    """End this process when its parent has ended: a killed parent tells its workers nothing."""
    while os.getppid() == parent:
        time.sleep(WATCH_EVERY_S)
    os._exit(1)
