"""What runs need: the pool of processes for clips, and the store as an IO manager that brings inputs up to date."""

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
    """How the clips of an asset are spread over processes, on this machine or on a Dask cluster (`ClipPool`)."""

    backend: str = "loky"
    """`loky`: processes on this machine; `sequential`: the run's own process; `dask`: workers of a cluster."""
    workers: int = 0
    """Number of processes on this machine; 0 means one a core."""
    address: str = ""
    """Of `dask`: the scheduler's address; empty for a cluster of worker processes on this machine."""

    def pool(self) -> ClipPool:
        return ClipPool(backend=self.backend, workers=self.workers, address=self.address)


class StoreIOManager(dg.ConfigurableIOManager):
    """Manifests in the project's store. Before the first step of a run, what is missing or stale upstream is made.

    It happens here because resources are set up before Dagster notes the versions of a step's inputs. One run
    works on the store at a time; a second one waits. A training leaves it to others (`store_left_to_others`).
    """

    bootstrap: bool = True
    """Materialize what is missing or stale upstream of a run's assets first. Off: use what is there."""

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
    """A lock on the store, released by the system when the process dies."""
    path = PROJECT.store.root / LOCK
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+") as stream:
        held = (stream, f"run {context.run_id} (process {os.getpid()})")
        _take(*held, context.log)
        _HELD.append(held)
        try:
            yield
        finally:
            _HELD.remove(held)


_HELD: list[tuple[IO[str], str]] = []
"""The lock on the store that this process holds, and the text that names the holder."""


@contextmanager
def store_left_to_others(log: Any) -> Iterator[None]:
    """Release the store to other runs while the context lasts; then wait for it and take it again.

    For work that lasts long and changes nothing in the store. The caller checks afterwards whether its inputs have
    changed.
    """
    held = tuple(_HELD)
    for stream, _ in held:
        stream.truncate(0)
        fcntl.flock(stream, fcntl.LOCK_UN)
    try:
        yield
    finally:
        for each in held:
            _take(*each, log)


def _take(stream: IO[str], holder: str, log: Any) -> None:
    """Lock the store's file, waiting for who has it, and record the new holder."""
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
