"""Which runs are alive, and how often the runs that a sensor or a schedule started have failed in a row.

Each run holds a lock on a file of its own, which the system releases when its process ends. A killed run stays STARTED
in Dagster's history; the next run marks it as FAILURE. A run that is recorded as started but holds no lock after
`START_S` is dead.
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
    """Mark a run as alive while the context lasts. Its file is locked before it gets its name."""
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
    """Report as failed the started runs whose process is gone, and what they had started; their ids."""
    dead = {path.name for path in folder.glob("*") if not path.name.startswith(".") and _is_dead(path)}
    started = instance.get_runs(filters=dg.RunsFilter(statuses=[dg.DagsterRunStatus.STARTED]))
    failed = [run for run in started if run.run_id in dead or run.tags.get(BOOTSTRAP_TAG) in dead]
    for run in failed:
        instance.report_run_failed(run, "Its process died without a word; the last good version of every asset stays.")
    for run_id in dead:
        (folder / run_id).unlink(missing_ok=True)
    return [run.run_id for run in failed]


def _is_dead(path: Path) -> bool:
    """Whether a file exists that no process holds; a file that disappears meanwhile is of a run that just ended."""
    try:
        with path.open() as stream:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, FileNotFoundError):
        return False
    return True


START_S = 600.0
"""A run holds its lock at the latest this long after it was requested [s]."""
LOOK_BACK = 20


@dataclass(frozen=True, kw_only=True)
class RecentRuns:
    """The newest runs that a sensor or schedule started for the same reason."""

    running: bool
    failures: int
    """Failed runs in a row, counted from the newest."""
    cancelled: bool
    """Whether a person cancelled the newest of these: it is not tried again until something changes."""
    last_run: str
    """Id of the newest; empty where there is none."""

    def why_not_now(self, what: str, most: int, by_hand: str) -> str:
        """Why no run is started now for `what`; empty if one may start.

        Args:
            what: what the run is for, in the sentence
            most: failed runs in a row after which none is started
            by_hand: what a person can do
        """
        if self.running:
            return f"a run was started for {what}"
        if self.cancelled:
            return f"run {self.last_run} for {what} was cancelled; a change starts one, or {by_hand}"
        if self.failures >= most:
            return f"{self.failures} runs for {what} came to nothing; look at run {self.last_run}, then {by_hand}"
        return ""


def recent_runs(
    instance: dg.DagsterInstance, project: Project, runs: dg.RunsFilter, is_failure: Callable[[dg.DagsterRun], bool]
) -> RecentRuns:
    """The newest of some runs; those whose process is gone are marked as failed first.

    Args:
        is_failure: whether a run that ended came to nothing
    """
    folder = project.store.root / "runs"
    fail_dead_runs(instance, folder)
    under_way, over = [], []
    for record in instance.get_run_records(filters=runs, limit=LOOK_BACK):
        run, path = record.dagster_run, folder / record.dagster_run.run_id
        young = time.time() - record.create_timestamp.timestamp() < START_S
        waits = run.status == dg.DagsterRunStatus.QUEUED or young or (path.is_file() and not _is_dead(path))
        (under_way if waits and not run.is_finished else over).append(run)
    failed = list(itertools.takewhile(is_failure, over))
    return RecentRuns(
        running=bool(under_way),
        failures=len(failed),
        cancelled=bool(failed) and failed[0].status == dg.DagsterRunStatus.CANCELED,
        last_run=over[0].run_id if over else "",
    )
