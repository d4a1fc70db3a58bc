"""Distribute clips over a Dask cluster: an existing one at an address, or worker processes on this machine.

A task contains several calls, since each task costs the scheduler some milliseconds; towards the end tasks are single
calls, so that workers finish together. Tasks of a worker that dies are moved to others; the calls of a task that killed
several workers are tried one by one. Results are collected as they arrive and returned in order. Few tasks are
submitted at a time, so the scheduler's memory does not grow with the number of clips.
"""

import atexit
import contextlib
import functools
import logging
import operator
import runpy
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.batch.code_version import LIBRARIES, PACKAGE, installed
from pipeline.errors import PipelineError

TASKS_PER_WORKER = 4
"""Submitted tasks per worker."""
MOST_A_TASK = 8
"""Most calls per task."""
CONNECT_S = 20.0
"""Timeout for the scheduler, and then for its first worker [s]."""


class ClusterError(PipelineError):
    """Raised for a Dask cluster that can't be used; `problem` includes the remedy."""

    def __init__(self, problem: str):
        super().__init__(f"clip_pool (backend dask): {problem}")


@dataclass(frozen=True, kw_only=True)
class Cluster:
    """A cluster whose workers run this process's code."""

    client: Any
    """`distributed.Client`."""
    code: Mapping[str, Any]
    """Definitions of `shipped_code`, sent by value."""
    digest: str
    """Digest of the code that workers run."""

    @property
    def workers(self) -> int:
        return len(self.client.scheduler_info(n_workers=-1)["workers"])

    def text(self) -> str:
        """Address of the cluster, and the link to Dask's dashboard."""
        return (
            f"dask: {self.workers} workers, scheduler {self.client.scheduler.address}, "
            f"dashboard {self.client.dashboard_link}"
        )

    def map(
        self,
        function: Callable[..., Any],
        calls: Sequence[tuple],
        shared: Sequence[Path],
        on_lost: Callable[[str], Any] | None,
    ) -> Iterator[Any]:
        """`ClipPool.map` on the cluster."""
        import cloudpickle

        with _probes(shared) as probes:
            alike = (cloudpickle.dumps(function), self.digest, probes)
            work = self.client.submit(self.code["load"], *alike, pure=False, retries=2)
            tasks = _Tasks(self.client, work, calls)
            most = TASKS_PER_WORKER * max(self.workers, 1)
            done: dict[int, Any] = {}
            try:
                for wanted in range(len(calls)):
                    while wanted not in done:
                        tasks.submit_up_to(most)
                        indices, results = tasks.next_done()
                        if not isinstance(results, str):
                            done.update(zip(indices, results, strict=True))
                        elif len(indices) > 1:
                            tasks.submit_each(indices)
                        elif on_lost is None:
                            raise ClusterError(f"a task is lost: {results}")
                        else:
                            done[indices[0]] = on_lost(results)
                    yield done.pop(wanted)
            finally:
                tasks.cancel()


class _Tasks:
    """Calls submitted to the scheduler, several per task."""

    def __init__(self, client: Any, work: Any, calls: Sequence[tuple]):
        import distributed

        self._client, self._work, self._calls = client, work, calls
        self._futures = distributed.as_completed(loop=client.loop)
        self._indices: dict[Any, range] = {}
        self._begun = 0

    def submit_up_to(self, most: int) -> None:
        """Submit the next calls until `most` tasks are pending; tasks get smaller as fewer calls are left."""
        while len(self._indices) < most and self._begun < len(self._calls):
            count = min(max((len(self._calls) - self._begun) // most, 1), MOST_A_TASK)
            self._submit(range(self._begun, self._begun + count))
            self._begun += count

    def submit_each(self, indices: range) -> None:
        """Submit each call as a separate task."""
        for index in indices:
            self._submit(range(index, index + 1))

    def _submit(self, indices: range) -> None:
        import cloudpickle

        # Bytes, as the scheduler looks inside; and a function that pickles by name, as each task sends it.
        calls = cloudpickle.dumps([self._calls[index] for index in indices])
        future = self._client.submit(operator.call, self._work, calls, pure=False)
        self._indices[future] = indices
        self._futures.add(future)

    def next_done(self) -> tuple[range, list[Any] | str]:
        """Indices of the calls of a finished task, and their results or a sentence that they are lost.

        Raises ClusterError for a worker that can't be used for this run, and the error of a call.
        """
        from distributed import KilledWorker

        future = next(self._futures)
        indices = self._indices.pop(future)
        try:
            unfit, results = future.result()
        except KilledWorker as error:
            workers = error.allowed_failures + 1
            return indices, f"each of {workers} worker processes that worked on it died (out of memory?)."
        if unfit:
            raise ClusterError(unfit)
        return indices, results

    def cancel(self) -> None:
        """Cancel unfinished tasks."""
        self._client.cancel(list(self._indices), force=True)


@functools.cache
def connected(address: str, workers: int) -> Cluster:
    """The cluster at an address, or one of `workers` processes on this machine; kept until this process ends.

    Raises ClusterError if Dask is not installed, nothing answers, or a worker can't run this process's code.
    """
    try:
        import distributed
    except ImportError as error:
        raise ClusterError("Dask is not installed; run: pip install 'booster-lab[cluster]'") from error
    logging.getLogger("distributed").setLevel(logging.WARNING)
    cluster = None if address else _local_cluster(workers)
    try:
        client = distributed.Client(cluster or address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(f"no scheduler answers at {address} ({error}); start one: dask scheduler") from error
    _OPEN.append((client, cluster))
    try:
        client.wait_for_workers(1, timeout=CONNECT_S)
    except TimeoutError as error:
        do = f"start some: dask worker {address} --nthreads 1 --nworkers auto"
        raise ClusterError(f"the scheduler at {address} has no workers; {do}") from error
    # Run, not imported: what it defines belongs to no module that scheduler and workers would have to have.
    code = runpy.run_path(str(Path(__file__).with_name("shipped_code.py")))
    plugin = code["ShippedCode"](PACKAGE.parent, {name: installed(name) for name in LIBRARIES})
    try:
        client.register_plugin(plugin)
    except RuntimeError as error:
        raise ClusterError(f"{error}.") from error
    return Cluster(client=client, code=code, digest=plugin.digest)


def _local_cluster(workers: int) -> Any:
    """Worker processes on this machine, reachable only from it."""
    import distributed

    return distributed.LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
        memory_limit=None,
    )


_OPEN: list[tuple[Any, Any]] = []
"""Clients of this process, each with its cluster if that is on this machine."""


@atexit.register
def disconnect() -> None:
    """Disconnect from all clusters and close those of this process, without Dask's logs about ended threads."""
    if _OPEN:
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
    while _OPEN:
        for each in _OPEN.pop():
            if each is not None:
                with contextlib.suppress(Exception):
                    each.close()
    connected.cache_clear()


@contextlib.contextmanager
def _probes(folders: Sequence[Path]) -> Iterator[tuple[str, ...]]:
    """Context with a probe file in each folder: a worker that does not see it has another folder at that path."""
    probes = tuple(folder / f".shared.{uuid.uuid4().hex}" for folder in folders)
    try:
        for probe in probes:
            probe.parent.mkdir(parents=True, exist_ok=True)
            probe.touch()
        yield tuple(map(str, probes))
    finally:
        for probe in probes:
            probe.unlink(missing_ok=True)
