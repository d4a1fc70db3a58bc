"""Memory growth of a process that retargets many clips: resident memory early and late, over different clips."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from benchmarks.report import Bar
from pipeline.retarget import RetargetSettings, process
from pipeline.robot import Robot
from tests.factories.human_clips import Gait, walker

WARM = 100
"""Clips before the first measurement, after which allocators have settled."""

MOST_GROWTH_MB = 5.0
"""Largest growth from the first to the last measurement [MB]."""


def bars(count: int, settings: RetargetSettings, robot: Robot) -> list[Bar]:
    """Memory growth over `count` walks of one second at different speeds."""
    first = 0.0
    for index in range(count):
        human = walker(seconds=1.0, gait=Gait(speed_m_s=0.2 + 1.4 * (index % 97) / 97.0))
        process(dataclasses.replace(human, name=f"walk {index}"), {}, settings=settings, robot=robot)
        if index == min(WARM, count - 1):
            first = resident_mb()
    return [
        Bar(name=f"resident memory after {min(WARM, count - 1) + 1} clips", value=first, unit="MB"),
        Bar(
            name=f"growth up to {count} clips",
            value=resident_mb() - first,
            unit="MB",
            sense="<=",
            bound=MOST_GROWTH_MB,
        ),
    ]


def resident_mb() -> float:
    """Resident memory of this process [MB] (Linux)."""
    status = Path("/proc/self/status").read_text()
    line = next(line for line in status.splitlines() if line.startswith("VmRSS"))
    return float(line.split()[1]) / 1024.0
