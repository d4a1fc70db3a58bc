"""Which runs are alive, and how many runs of a sensor or schedule failed in a row.

Each run holds a lock on its own file, which the operating system releases when the process ends. A killed run stays
STARTED in Dagster's history; the next run marks it as FAILURE. A run that is recorded as started but holds no lock
after `START_S` is dead.
"""

import fcntl
import itertools
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import dagster as dg

from assets.bootstrap import BOOTSTRAP_TAG
from pipeline.project import Project


@contextmanager
def alive(folder: Path, run_id: str) -> Iterator[None]:
    """Mark a run as alive during the context. The file is locked before it is renamed to the run's id."""
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


def fail_dead_runs(instance: dg.DagsterInstance, folder: Path) -> list[str]:
    """Mark started runs without a process, and the runs they had started, as failed. Returns their ids."""
    dead = {path.name for path in folder.glob("*") if not path.name.startswith(".") and _is_dead(path)}
    started = instance.get_runs(filters=dg.RunsFilter(statuses=[dg.DagsterRunStatus.STARTED]))
    failed = [run for run in started if run.run_id in dead or run.tags.get(BOOTSTRAP_TAG) in dead]
    for run in failed:
        instance.report_run_failed(run, "Its process ended without a report; every asset keeps its last valid version.")
    for run_id in dead:
        (folder / run_id).unlink(missing_ok=True)
    return [run.run_id for run in failed]


def _is_dead(path: Path) -> bool:
    """Whether the file exists and no process locks it. If it disappears meanwhile, its run has just ended normally."""
    try:
        with path.open() as stream:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, FileNotFoundError):
        return False
    return True


START_S = 600.0
"""Longest time from the request of a run until it holds its lock [s]."""
LOOK_BACK = 20
"""Number of recent runs to inspect."""


@dataclass(frozen=True, kw_only=True)
class RecentRuns:
    """State of the newest runs that a sensor or schedule started for the same reason."""

    running: bool
    failures: int
    """Failed runs in a row, counted from the newest."""
    cancelled: bool
    """Whether a person cancelled the newest failed run; no run is started again until something changes."""
    last_run: str
    """Id of the newest finished run; empty if there is none."""

    def why_not_now(self, what: str, most: int, by_hand: str) -> str:
        """Why no run is started now for `what`; empty if one may start.

        Args:
            what: purpose of the run, as part of the message
            most: number of failed runs in a row after which none is started
            by_hand: instruction for a person, as part of the message
        """
        if self.running:
            return f"a run for {what} is in progress"
        if self.cancelled:
            return f"run {self.last_run} for {what} was cancelled; the next change starts a new one, or {by_hand}"
        if self.failures >= most:
            return f"{self.failures} runs for {what} failed; read the log of run {self.last_run}, then {by_hand}"
        return ""


def recent_runs(
    instance: dg.DagsterInstance, project: Project, runs: dg.RunsFilter, is_failure: Callable[[dg.DagsterRun], bool]
) -> RecentRuns:
    """State of the newest runs that match a filter. Runs without a process are marked as failed first.

    Args:
        instance: Dagster instance with the history
        project: project with the lock files
        runs: filter of the runs
        is_failure: whether a finished run counts as failed
    """
    folder = project.store.root / "runs"
    fail_dead_runs(instance, folder)
    active, finished = [], []
    for record in instance.get_run_records(filters=runs, limit=LOOK_BACK):
        run, path = record.dagster_run, folder / record.dagster_run.run_id
        young = time.time() - record.create_timestamp.timestamp() < START_S
        waits = run.status == dg.DagsterRunStatus.QUEUED or young or (path.is_file() and not _is_dead(path))
        (active if waits and not run.is_finished else finished).append(run)
    failed = list(itertools.takewhile(is_failure, finished))
    return RecentRuns(
        running=bool(active),
        failures=len(failed),
        cancelled=bool(failed) and failed[0].status == dg.DagsterRunStatus.CANCELED,
        last_run=finished[0].run_id if finished else "",
    )
