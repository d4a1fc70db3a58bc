"""Run a command and sample memory and CPU time of its process tree.

CPU time of ended processes is included in their parents' (`cutime`, `cstime` of /proc/PID/stat), so that of short
processes is counted too. Memory of a process that lives for less than `LIST_EVERY_S` may be missed.
"""

from __future__ import annotations

import os
import resource
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil

PERIOD_S = 0.05
LIST_EVERY_S = 0.1
"""Interval at which descendants are listed [s], which is slower than sampling them."""
MB = 1e6


@dataclass(frozen=True, kw_only=True)
class Sample:
    """Resident memory at one time [MB]. Shared pages count once per process."""

    time_s: float
    """Seconds since the epoch, as in Dagster's events."""
    main_mb: float
    """Memory of the command's process [MB]."""
    tree_mb: float
    """Memory of the process and its descendants [MB]."""
    cpu_s: float
    """Processor time, user and system, of all processes so far, those that have ended and were waited for included
    [s]."""


@dataclass(frozen=True, kw_only=True)
class Watched:
    """Result of a command that has ended."""

    started_s: float
    """Seconds since the epoch."""
    wall_s: float
    cpu_s: float
    """Processor time, user and system, of the command and all processes below it that were waited for [s]."""
    samples: tuple[Sample, ...]
    output: str

    def peak(self, start_s: float = 0.0, stop_s: float = float("inf")) -> tuple[float, float]:
        """Largest `main_mb` and `tree_mb` between two times (epoch); without samples between, the nearest ones."""
        inside = [each for each in self.samples if start_s <= each.time_s <= stop_s]
        if not inside:
            inside = [min(self.samples, key=lambda each: abs(each.time_s - start_s))]
        return max(each.main_mb for each in inside), max(each.tree_mb for each in inside)

    def cpu_between(self, start_s: float, stop_s: float) -> float:
        """CPU time of all processes between two times (epoch), within the sampling period [s]."""
        before, after = (
            max((each.cpu_s for each in self.samples if each.time_s <= time_s), default=0.0)
            for time_s in (start_s, stop_s)
        )
        return after - before


def watch(command: Sequence[str], *, folder: Path, environment: Mapping[str, str], log: Path) -> Watched:
    """Run a command in a folder, output to the file `log`. Raises RuntimeError with its last lines if it fails."""
    samples: list[Sample] = []
    before_s, cpu_s = _ended_cpu_s(), 0.0
    started_s, clock_s = time.time(), time.perf_counter()
    with log.open("w") as stream:
        process = subprocess.Popen(
            command, cwd=folder, env={**environment}, stdout=stream, stderr=subprocess.STDOUT, text=True
        )
        main, tree, listed_s = psutil.Process(process.pid), [], -LIST_EVERY_S
        while process.poll() is None:
            if time.perf_counter() - listed_s >= LIST_EVERY_S:
                tree, listed_s = _tree(main), time.perf_counter()
            for sample in _sample(tree, cpu_s):
                samples.append(sample)
                cpu_s = sample.cpu_s
            time.sleep(PERIOD_S)
    wall_s = time.perf_counter() - clock_s
    output = log.read_text()
    if process.returncode != 0:
        raise RuntimeError(f"{' '.join(command)} ended with {process.returncode}:\n{output[-3000:]}")
    cpu_s = _ended_cpu_s() - before_s
    return Watched(started_s=started_s, wall_s=wall_s, cpu_s=cpu_s, samples=tuple(samples), output=output)


def clean_environment(root: Path, executables: Path) -> dict[str, str]:
    """Environment of a user's shell: no setting of this project, Dagster or Python; `root` is importable."""
    settings = ("DAGSTER", "BOOSTER_LAB", "PYTHON")
    kept = {name: value for name, value in os.environ.items() if not name.startswith(settings)}
    return {**kept, "PATH": f"{executables}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(root)}


def _tree(main: psutil.Process) -> list[psutil.Process]:
    """The process and its descendants; empty if it has ended."""
    try:
        return [main, *main.children(recursive=True)]
    except psutil.NoSuchProcess:
        return []


def _ended_cpu_s() -> float:
    """CPU time of the ended descendants of this process [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _sample(processes: Sequence[psutil.Process], least_cpu_s: float) -> list[Sample]:
    """Take one sample; None if the first process has ended.

    Args:
        least_cpu_s: CPU time of the previous sample, a lower bound: a process that ends during the sampling may be
            counted neither by itself nor by its parent
    """
    memory, cpu_s = [], 0.0
    for process in processes:
        try:
            with process.oneshot():
                own_mb, times = process.memory_info().rss / MB, process.cpu_times()
        except psutil.NoSuchProcess:
            if not memory:
                return []
            continue
        memory.append(own_mb)
        cpu_s += times.user + times.system + times.children_user + times.children_system
    if not memory:
        return []
    return [Sample(time_s=time.time(), main_mb=memory[0], tree_mb=sum(memory), cpu_s=max(cpu_s, least_cpu_s))]
