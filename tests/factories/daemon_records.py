"""What the daemon and the runs of a checkout leave behind: ticks of a sensor, times of runs, processor time."""

import os
from dataclasses import dataclass
from pathlib import Path

import dagster as dg
from dagster._core.scheduler.instigation import InstigatorTick

from tests.factories.checkout import Checkout


@dataclass(frozen=True, kw_only=True)
class RunTimes:
    """A run of a job, by the history."""

    run_id: str
    status: str
    start_s: float
    end_s: float


def ticks_of(checkout: Checkout, sensor: str) -> list[InstigatorTick]:
    """Ticks of a sensor, the oldest first."""
    with checkout.instance() as instance:
        states = [state for state in instance.all_instigator_state() if state.instigator_name == sensor]
        ticks = [tick for state in states for tick in instance.get_ticks(state.instigator_origin_id, state.selector_id)]
    return sorted(ticks, key=lambda tick: tick.timestamp)


def runs_of(checkout: Checkout, job: str) -> list[RunTimes]:
    """Runs of a job, the oldest first."""
    with checkout.instance() as instance:
        records = instance.get_run_records(filters=dg.RunsFilter(job_name=job), ascending=True)
    return [
        RunTimes(
            run_id=record.dagster_run.run_id,
            status=record.dagster_run.status.value,
            start_s=record.start_time or 0.0,
            end_s=record.end_time or 0.0,
        )
        for record in records
    ]


class ProcessorTime:
    """Processor time of a checkout's runs [s], as long as they are looked at while they live. Linux tells it."""

    def __init__(self, checkout: Checkout):
        self._folder = checkout.root / "data/store/runs"
        self.of_run: dict[str, float] = {}

    def look(self) -> None:
        """Note what the runs that are alive have used so far, their ended children included."""
        for lock in self._folder.glob("*"):
            try:
                pid = int(lock.read_text().removeprefix("process "))
                fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
            except (OSError, ValueError):
                continue
            self.of_run[lock.name] = sum(int(each) for each in fields[11:15]) / os.sysconf("SC_CLK_TCK")
