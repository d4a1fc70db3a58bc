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
"""How often a worker process looks whether its parent is there."""


LOKY, SEQUENTIAL, DASK = "loky", "sequential", "dask"
BACKENDS = (LOKY, SEQUENTIAL, DASK)


@dataclass(frozen=True, kw_only=True)
class ClipPool:
    """How clips are spread over processes. Raises UnknownNameError for a backend that is none."""

    backend: str = LOKY
    """`loky`: processes on this machine; `sequential`: this process; `dask`: workers of a Dask cluster."""
    workers: int = 0
    """Number of processes; 0 means one for each core that this process may use, as its affinity and its container's
    share have it. The cluster at an address has its own number."""
    address: str = ""
    """Of `dask`: the scheduler's, such as `tcp://10.0.0.5:8786`; empty for a cluster of this process's own, of
    `workers` processes on this machine."""

    def __post_init__(self) -> None:
        if self.backend not in BACKENDS:
            raise UnknownNameError("backend of clip_pool", self.backend, BACKENDS)
        if self.address and self.backend != DASK:
            raise PipelineError(f"clip_pool: the address {self.address} is one of a Dask cluster; set backend to dask.")

    def on_this_machine(self) -> ClipPool:
        """The pool, or processes of this machine in place of a cluster."""
        if self.backend != DASK:
            return self
        return dataclasses.replace(self, backend=LOKY, workers=0 if self.address else self.workers, address="")

    def where(self) -> str:
        """Where a cluster is and the link to its dashboard; empty where calls run on this machine without one."""
        return self._cluster().text() if self.backend == DASK else ""

    def map(
        self,
        function: Callable[..., Any],
        calls: Sequence[tuple],
        *,
        shared: Sequence[Path] = (),
        on_lost: Callable[[str], Any] | None = None,
    ) -> Iterator[Any]:
        """Results of `function(*call)` for each call, in order, as they come.

        A single call, or a pool of one worker, runs in this process. Processes on this machine begin at once and end
        with this one, however it ends. Of a cluster, the calls of a worker that dies go to other workers.

        Args:
            shared: folders that calls read and write, which a cluster's workers must see under the same path
            on_lost: result of a call that each of several workers of a cluster died of, made of a sentence that says
                so; without it ClusterError is raised
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
    """What a pickled function makes of `call`, in a worker process that ends when its parent does."""
    if not _WATCHED and os.getppid() == parent:
        _WATCHED.append(parent)
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()
    return _unpickled(function)(*call)


@functools.lru_cache(maxsize=1)
def _unpickled(function: bytes) -> Callable[..., Any]:
    """The function, and with it what it holds (a robot), the same for one call after the other. Its bytes are
    those that the parent made: nothing is unpickled that came from a file."""
    return cloudpickle.loads(function)


_WATCHED: list[int] = []
"""The parent that this process is watching, once it does."""


def _watch(parent: int) -> None:
    """End this process when its parent has ended: a killed parent tells its workers nothing."""
    while os.getppid() == parent:
        time.sleep(WATCH_EVERY_S)
    os._exit(1)
