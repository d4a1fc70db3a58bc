"""Parallel processes for clips, through joblib: the backend is a setting, so a cluster is one too."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import joblib


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

        A single call, or a pool of one worker, runs in this process.
        """
        workers = min(self.workers or joblib.cpu_count(), len(calls))
        if workers <= 1 or self.backend == "sequential":
            yield from (function(*call) for call in calls)
            return
        with joblib.parallel_config(backend=self.backend, n_jobs=workers):
            parallel = joblib.Parallel(return_as="generator", pre_dispatch="2*n_jobs")
            yield from parallel(joblib.delayed(function)(*call) for call in calls)
