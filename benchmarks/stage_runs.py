"""Duration, memory and clips of each stage in a run of the README's command, from Dagster's history."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import dagster as dg
import pandas as pd

from benchmarks.process_tree import Watched
from pipeline.batch import Store

CLIP_STAGES = (
    "motion_catalog",
    "selected_motions",
    "repaired_motions",
    "retargeted_motions",
    "motion_variants",
    "reference_motions",
    "augmented_motions",
    "feasible_motions",
)
STAGES = (*CLIP_STAGES, "robot_model", "tracking_policy", "expert_db", "expert_db_checks")
BETWEEN = "start and between"
"""Time outside steps: interpreter, imports, staleness checks, Dagster's bookkeeping."""


@dataclass(frozen=True, kw_only=True)
class StageRun:
    seconds: float
    """Wall time of its step [s]; for `start and between`, the rest of the command's."""
    cpu_s: float
    """CPU time of all processes during the step [s]."""
    main_mb: float
    """Peak resident memory of the command's process during the step [MB]; for `start and between`, before the steps."""
    tree_mb: float
    """Peak resident memory of all processes together [MB]."""
    recomputed: int | None = None
    """Number of recomputed clips; None if a stage does not process clips."""
    unexpected: int | None = None
    """Difference from the number of clips of the changed file; None without a changed clip."""


@dataclass(frozen=True, kw_only=True)
class CommandRun:
    wall_s: float
    cpu_s: float
    main_mb: float
    tree_mb: float
    arrived: int
    """Number of motion files with clips in the database."""
    stages: dict[str, StageRun]
    """Stages that ran, and `start and between`."""

    @property
    def recomputed(self) -> int:
        return sum(stage.recomputed or 0 for stage in self.stages.values())

    @property
    def unexpected(self) -> int:
        return sum(abs(stage.unexpected or 0) for stage in self.stages.values())


def read_run(root: Path, watched: Watched, changed: str) -> CommandRun:
    """Read the watched run in the checkout `root`; `changed` names the clip of the changed motion file."""
    stages = {}
    with _instance(root) as instance:
        spans = _spans(instance, watched.started_s)
        for name, (start_s, stop_s) in spans.items():
            main_mb, tree_mb = watched.peak(start_s, stop_s)
            recomputed = _recomputed(instance, name) if name in CLIP_STAGES else None
            expected = _clips_of(root, name, changed) if changed and name in CLIP_STAGES else None
            stages[name] = StageRun(
                seconds=stop_s - start_s,
                cpu_s=watched.cpu_between(start_s, stop_s),
                main_mb=main_mb,
                tree_mb=tree_mb,
                recomputed=recomputed,
                unexpected=None if expected is None or recomputed is None else recomputed - expected,
            )
    between_s = watched.wall_s - sum(stage.seconds for stage in stages.values())
    between_cpu_s = watched.cpu_s - sum(stage.cpu_s for stage in stages.values())
    before = watched.peak(0.0, min(start_s for start_s, _ in spans.values()))
    stages[BETWEEN] = StageRun(seconds=between_s, cpu_s=between_cpu_s, main_mb=before[0], tree_mb=before[1])
    main_mb, tree_mb = watched.peak()
    return CommandRun(
        wall_s=watched.wall_s,
        cpu_s=watched.cpu_s,
        main_mb=main_mb,
        tree_mb=tree_mb,
        arrived=len(set(pd.read_parquet(root / "data/expert_db/t1/index.parquet")["source_file"])),
        stages=stages,
    )


@contextlib.contextmanager
def _instance(root: Path) -> Iterator[dg.DagsterInstance]:
    """Open the history of a checkout; its dagster.yaml names folders relative to the working directory."""
    before = Path.cwd()
    os.chdir(root)
    try:
        with dg.DagsterInstance.from_config(str(root)) as instance:
            yield instance
    finally:
        os.chdir(before)


def _spans(instance: dg.DagsterInstance, since_s: float) -> dict[str, tuple[float, float]]:
    """Start and end of each step of the runs since a time, in order [s since the epoch]."""
    spans = {}
    for record in instance.get_run_records():
        for step in instance.get_run_step_stats(record.dagster_run.run_id):
            if step.start_time is not None and step.end_time is not None and step.start_time > since_s:
                spans[step.step_key] = (step.start_time, step.end_time)
    return dict(sorted(spans.items(), key=lambda span: span[1]))


def _recomputed(instance: dg.DagsterInstance, name: str) -> int | None:
    """Number of clips that a stage recomputed; None if it does not process clips."""
    event = instance.get_latest_materialization_event(dg.AssetKey([name]))
    assert event is not None and event.asset_materialization is not None
    recomputed = event.asset_materialization.metadata.get("clips recomputed")
    if recomputed is None:
        return None
    assert isinstance(recomputed.value, int)
    return recomputed.value


def _clips_of(root: Path, stage: str, clip: str) -> int:
    """Number of input clips of a stage from one motion file: its clip, windows, pieces and variants."""
    names = Store(root=root / "data/store").load(stage).judged_table([])["clip"]
    return sum(name == clip or name.startswith((f"{clip}@", f"{clip}+", f"{clip}~")) for name in names)
