"""Dagster resources: the process pool for clips, and the store as an IO manager that updates stale inputs."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any

import dagster as dg

from assets.bootstrap import BOOTSTRAP_TAG, bring_up_to_date
from assets.report import as_failure
from assets.runs import alive, fail_dead_runs
from pipeline.batch import ClipPool, Manifest
from pipeline.batch.store import LOCK
from pipeline.project import PROJECT


class ClipPoolResource(dg.ConfigurableResource):
    """Distribution of the clips of a stage over processes, on this machine or on a Dask cluster (`ClipPool`)."""

    backend: str = "loky"
    """`loky`: processes on this machine; `sequential`: the run's own process; `dask`: workers of a cluster."""
    workers: int = 0
    """Number of processes on this machine; 0: one per core."""
    address: str = ""
    """Address of the Dask scheduler; empty: a local cluster on this machine."""

    def pool(self) -> ClipPool:
        return ClipPool(backend=self.backend, workers=self.workers, address=self.address)


class StoreIOManager(dg.ConfigurableIOManager):
    """IO manager for manifests in the project's store. Before the first step of a run, it updates stale inputs.

    The update is here because Dagster initializes resources before it records the versions of a step's inputs. One run
    holds the store at a time; a second one waits. A training releases it meanwhile (`store_released`).
    """

    bootstrap: bool = True
    """First materialize missing and stale upstream assets. Off: use the stored results."""

    @contextmanager
    def yield_for_execution(self, context: dg.InitResourceContext) -> Iterator["StoreIOManager"]:
        run, instance = context.run, context.instance
        if run is None or instance is None or BOOTSTRAP_TAG in run.tags:
            yield self
            return
        runs = PROJECT.store.root / "runs"
        with alive(runs, run.run_id), _one_run_at_a_time(context):
            with as_failure():
                fail_dead_runs(instance, runs)
                if self.bootstrap:
                    bring_up_to_date(instance, run, PROJECT, context.log)
            yield self

    def handle_output(self, context: dg.OutputContext, obj: Manifest) -> None:
        key = context.asset_key.to_user_string()
        PROJECT.store.save(key, obj)
        context.add_output_metadata({"dagster/uri": dg.MetadataValue.path(str(PROJECT.store.manifest_path(key)))})

    def load_input(self, context: dg.InputContext) -> Manifest:
        return PROJECT.store.load(context.asset_key.to_user_string())


@contextmanager
def _one_run_at_a_time(context: dg.InitResourceContext) -> Iterator[None]:
    """Hold the lock on the store; the operating system releases it when the process ends."""
    path = PROJECT.store.root / LOCK
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+") as stream:
        held = (stream, f"run {context.run_id} (process {os.getpid()})")
        _acquire(*held, context.log)
        _HELD.append(held)
        try:
            yield
        finally:
            _HELD.remove(held)


_HELD: list[tuple[IO[str], str]] = []
"""The lock on the store that this process holds, and the text that names the holder."""


@contextmanager
def store_released(log: Any) -> Iterator[None]:
    """Release the lock on the store during the context, then acquire it again.

    For long work that does not change the store. The caller has to check afterwards whether its inputs changed.
    """
    held = tuple(_HELD)
    for stream, _ in held:
        stream.truncate(0)
        fcntl.flock(stream, fcntl.LOCK_UN)
    try:
        yield
    finally:
        for each in held:
            _acquire(*each, log)


def _acquire(stream: IO[str], holder: str, log: Any) -> None:
    """Lock the store's file, waiting for the current holder, and write the new holder to it."""
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        stream.seek(0)
        if log:
            log.info(f"waiting for {stream.read().strip() or 'another run'} to finish with the store")
        fcntl.flock(stream, fcntl.LOCK_EX)
    stream.truncate(0)
    stream.write(holder)
    stream.flush()
