"""Parallel processes for clips: on this machine through joblib, on a cluster through Dask."""

from __future__ import annotations

import dataclasses
import functools
import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cloudpickle
import joblib

from pipeline.errors import PipelineError, UnknownNameError

WATCH_EVERY_S = 1.0
"""Interval at which a worker process checks that its parent exists [s]."""


LOKY, SEQUENTIAL, DASK = "loky", "sequential", "dask"
BACKENDS = (LOKY, SEQUENTIAL, DASK)


@dataclass(frozen=True, kw_only=True)
class ClipPool:
    """Distribution of clips over processes. Raises UnknownNameError for an unknown backend."""

    backend: str = LOKY
    """`loky`: processes on this machine; `sequential`: this process; `dask`: workers of a Dask cluster."""
    workers: int = 0
    """Number of processes; 0: one per core available to this process by affinity and container limits. A cluster at an
    address has its own number."""
    address: str = ""
    """For `dask`: address of the scheduler, such as `tcp://10.0.0.5:8786`; empty for a local cluster of `workers`
    processes."""

    def __post_init__(self) -> None:
        if self.backend not in BACKENDS:
            raise UnknownNameError("backend of clip_pool", self.backend, BACKENDS)
        if self.address and self.backend != DASK:
            raise PipelineError(f"clip_pool: the address {self.address} is one of a Dask cluster; set backend to dask.")

    def on_this_machine(self) -> ClipPool:
        """This pool, or a pool of processes on this machine instead of a cluster."""
        if self.backend != DASK:
            return self
        return dataclasses.replace(self, backend=LOKY, workers=0 if self.address else self.workers, address="")

    def where(self) -> str:
        """Address of the cluster and link to its dashboard; empty without a cluster."""
        return self._cluster().text() if self.backend == DASK else ""

    def map(
        self,
        function: Callable[..., Any],
        calls: Sequence[tuple],
        *,
        shared: Sequence[Path] = (),
        on_lost: Callable[[str], Any] | None = None,
    ) -> Iterator[Any]:
        """Yield `function(*call)` for each call, in order.

        A single call, or a pool of one worker, runs in this process. Processes on this machine start immediately and
        end with this one, however it ends. On a cluster, calls of a worker that dies are moved to others.

        Args:
            function: picklable function
            calls: arguments of each call
            shared: folders that calls read and write, which a cluster's workers must see under the same path
            on_lost: makes the result of a call that killed several workers, from a sentence on it; None: ClusterError
                is raised
        """
        workers = self.workers or joblib.cpu_count()
        if self.backend == DASK and calls:
            return self._cluster().map(function, calls, shared, on_lost)
        if min(workers, len(calls)) <= 1 or self.backend == SEQUENTIAL:
            return (function(*call) for call in calls)
        with joblib.parallel_config(backend=LOKY, n_jobs=workers):
            parallel = joblib.Parallel(return_as="generator", pre_dispatch="2*n_jobs")
            work = partial(_ending_with, os.getpid(), cloudpickle.dumps(function))
            return iter(parallel(joblib.delayed(work)(*call) for call in calls))

    def _cluster(self) -> Any:
        from pipeline.batch.cluster import connected

        return connected(self.address, 0 if self.address else self.workers or joblib.cpu_count())


def _ending_with(parent: int, function: bytes, *call: Any) -> Any:
    """Apply a pickled function to `call` in a worker process that ends with its parent."""
    if not _WATCHED and os.getppid() == parent:
        _WATCHED.append(parent)
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()
    return _unpickled(function)(*call)


@functools.lru_cache(maxsize=1)
def _unpickled(function: bytes) -> Callable[..., Any]:
    """Unpickle the function with its data (a robot), cached across calls. The bytes come from the parent process, never
    from a file."""
    return cloudpickle.loads(function)


_WATCHED: list[int] = []
"""Process id of the watched parent, once the watch has started."""


def _watch(parent: int) -> None:
    """End this process when its parent has ended, since a killed parent does not notify its workers."""
    while os.getppid() == parent:
        time.sleep(WATCH_EVERY_S)
    os._exit(1)
