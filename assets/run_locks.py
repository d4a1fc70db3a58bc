"""Which runs are alive: each holds a lock on a file of its own, which the system releases when its process dies.

A killed run stays STARTED in Dagster's history for ever; the next run marks it as FAILURE.
"""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import dagster as dg

from assets.bootstrap import BOOTSTRAP_TAG


@contextmanager
def alive(folder: Path, run_id: str) -> Iterator[None]:
    """Say that a run is alive for as long as the context lasts. Its file is locked from when it has its name."""
    folder.mkdir(parents=True, exist_ok=True)
    path, draft = folder / run_id, folder / f".{run_id}"
    with draft.open("w") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        stream.write(f"process {os.getpid()}")
        stream.flush()
        draft.rename(path)
        try:
            yield
        finally:
            path.unlink(missing_ok=True)


def tell_dead_runs(instance: dg.DagsterInstance, folder: Path) -> list[str]:
    """Report as failed the started runs whose process is gone, and what they had started; their ids."""
    dead = {path.name for path in folder.glob("*") if not path.name.startswith(".") and _is_dead(path)}
    started = instance.get_runs(filters=dg.RunsFilter(statuses=[dg.DagsterRunStatus.STARTED]))
    failed = [run for run in started if run.run_id in dead or run.tags.get(BOOTSTRAP_TAG) in dead]
    for run in failed:
        instance.report_run_failed(run, "Its process died without a word; the last good version of every asset stays.")
    for run_id in dead:
        (folder / run_id).unlink(missing_ok=True)
    return [run.run_id for run in failed]


def is_held(path: Path) -> bool:
    """Whether a living process holds a run's file."""
    return path.is_file() and not _is_dead(path)


def _is_dead(path: Path) -> bool:
    """Whether a file is there that nobody holds; one that just went is of a run that just ended."""
    try:
        with path.open() as stream:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, FileNotFoundError):
        return False
    return True
