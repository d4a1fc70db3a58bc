"""Runs that a sensor or a schedule asked for: is one at work, and how many in a row came to nothing.

A run may die silently, with its machine or by a kill. What holds its lock is at work; what is recorded as at work
and holds none is not, once it had the time to take it.
"""

import itertools
import time
from collections.abc import Callable
from dataclasses import dataclass

import dagster as dg

from assets.project import Project
from assets.run_locks import is_held, tell_dead_runs

MAX_TRIES = 3
"""Runs in a row that may come to nothing before a person has to look."""
START_S = 600.0
"""In this time a run that was asked for holds its lock."""
LOOK_BACK = 20


@dataclass(frozen=True, kw_only=True)
class Tries:
    """What became of the newest runs for one thing."""

    at_work: bool
    in_vain: int
    """How many of the newest, in a row, came to nothing."""
    cancelled: bool
    """Whether a person cancelled the newest of these: it is not tried again until something changes."""
    last_run: str
    """Id of the newest; empty where there is none."""


def tries(
    instance: dg.DagsterInstance, project: Project, runs: dg.RunsFilter, in_vain: Callable[[dg.DagsterRun], bool]
) -> Tries:
    """Look at the newest of some runs; those whose process is gone are marked as failed first.

    Args:
        in_vain: whether a run that is over came to nothing
    """
    folder = project.store.root / "runs"
    tell_dead_runs(instance, folder)
    records = instance.get_run_records(filters=runs, limit=LOOK_BACK)
    over = [record.dagster_run for record in records]
    at_work = False
    for record in records:
        run = record.dagster_run
        age_s = time.time() - record.create_timestamp.timestamp()
        waits = run.status == dg.DagsterRunStatus.QUEUED or age_s < START_S or is_held(folder / run.run_id)
        if not run.is_finished and waits:
            at_work = True
            over.remove(run)
    failed = list(itertools.takewhile(in_vain, over))
    cancelled = bool(failed) and failed[0].status == dg.DagsterRunStatus.CANCELED
    return Tries(at_work=at_work, in_vain=len(failed), cancelled=cancelled, last_run=over[0].run_id if over else "")
