"""Time and memory of the README's command per stage, for few and many clips.

    python benchmarks/pipeline.py [--sizes 10,100] [--repeat 1] [--no-shipped] [--json] [--keep FOLDER]
    python benchmarks/pipeline.py --recordings ../shared/mocap/lafan1_60fps [--minutes 60] [--no-rollouts]

In a separate checkout the command `dagster asset materialize --select expert_db` runs over as many different clips, cut
from the shipped sound motions: cold, repeated without changes, and with one clip changed. Durations are from Dagster's
history; memory and CPU time are sampled over all processes. docs/benchmarks.md explains the numbers. With
`--recordings` the command runs cold, once, over copies of the BVH files of a folder, with `--no-rollouts` in a checkout
without a tracker.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.many_motions import file_name, sound_motions, write_clip, write_clips, write_copies, write_moved  # noqa: E402
from benchmarks.process_tree import clean_environment, watch  # noqa: E402
from benchmarks.report import Bar, machine, report  # noqa: E402
from benchmarks.stage_runs import BETWEEN, STAGES, CommandRun, read_run  # noqa: E402
from tests.factories.checkout import Checkout  # noqa: E402

COMMAND = ("dagster", "asset", "materialize", "--select", "expert_db")
COLD, UNCHANGED, ONE_CHANGED = "cold", "unchanged", "one changed"
SHIPPED = "shipped"
RECORDED, ROLLED_OUT = "recorded", "recorded, with rollouts"
SHIPPED_CHANGED = "curve_left"
"""Shipped motion that is shifted in the run with one changed clip."""

MOST_SHIPPED_S = 300.0
"""Main job on the shipped motions, on two cores [s]."""
MOST_UNCHANGED_S = 15.0
"""Command repeated without changes [s]."""
MOST_MAIN_MB_PER_CLIP = 1.0
"""Memory growth of the command's process per clip, which keeps names, numbers and reasons, never frames [MB]."""

MOST_CPU_PER_SECOND = 0.05
"""CPU time of all stages per second of recorded motion, without rollouts [s]."""
MOST_HOURS_FOR_40 = 1.0
"""Extrapolated wall time of 40 hours of recordings on two cores [h]."""

LEAST_ARRIVED = 90.0
"""Least share of the clips in the database; all are sound, and a stage that drops them would look fast [%]."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """One run of the command over a known amount of motion."""

    clips: int
    clip_seconds: float
    scenario: str
    run: CommandRun

    @property
    def name(self) -> str:
        return f"{self.clips} clips, {self.scenario}"


def main() -> None:
    arguments = _arguments()
    cases: list[Case] = []
    for _ in range(arguments.repeat):
        if arguments.recordings:
            cases += in_checkout(arguments.keep, recorded=Recorded.of(arguments))
            continue
        if arguments.shipped:
            cases += in_checkout(arguments.keep, shipped=True)
        for size in arguments.sizes:
            cases += in_checkout(arguments.keep, size=size)
    if not arguments.json:
        for case in cases:
            print_stages(case)
    described = {**machine(), "command": " ".join(COMMAND), "repeats": arguments.repeat}
    holds = report(bars(cases), machine=described, json=arguments.json)
    sys.exit(0 if holds else 1)


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """Amount of recorded motion, and whether references are rolled out."""

    folder: Path
    """Folder of BVH files."""
    seconds: float
    rollouts: bool

    @staticmethod
    def of(arguments: argparse.Namespace) -> Recorded:
        folder = arguments.recordings.resolve()
        return Recorded(folder=folder, seconds=60.0 * arguments.minutes, rollouts=arguments.rollouts)


def in_checkout(
    keep: Path | None, *, size: int = 0, shipped: bool = False, recorded: Recorded | None = None
) -> list[Case]:
    """Run the three cases over `size` clips or the shipped motions, or one over recordings, in a new checkout."""
    folder = keep or Path(tempfile.mkdtemp(prefix="booster_lab_benchmark_"))
    root = folder / (SHIPPED if shipped else RECORDED if recorded else f"{size}_clips")
    shutil.rmtree(root, ignore_errors=True)
    try:
        if recorded:
            return _recorded_cases(root, recorded)
        return _shipped_cases(root) if shipped else _sized_cases(root, size)
    finally:
        if keep is None:
            shutil.rmtree(folder)


def _sized_cases(root: Path, size: int) -> list[Case]:
    Checkout.make(ROOT, root, ())
    motions, folder = sound_motions(ROOT / "data/motions"), root / "data/motions"
    seconds = write_clips(motions, size, folder)
    cases = [_case(root, size, seconds, COLD), _case(root, size, seconds, UNCHANGED)]
    write_clip(motions, size // 2, folder, changed=True)
    changed = f"booster_lab/{Path(file_name(motions, size // 2)).stem}"
    return [*cases, _case(root, size, seconds, ONE_CHANGED, changed)]


def _shipped_cases(root: Path) -> list[Case]:
    names = tuple(path.stem for path in (ROOT / "data/motions").glob("*.bvh"))
    Checkout.make(ROOT, root, names)
    motions = sound_motions(root / "data/motions")
    seconds = sum(motion.frame_time_s * len(motion.frames) for motion in motions)
    cases = [_case(root, len(names), seconds, f"{SHIPPED}, {scenario}") for scenario in (COLD, UNCHANGED)]
    (changed,) = (motion for motion in motions if motion.name == SHIPPED_CHANGED)
    write_moved(changed, root / "data/motions")
    return [*cases, _case(root, len(names), seconds, f"{SHIPPED}, {ONE_CHANGED}", f"booster_lab/{changed.name}")]


def _recorded_cases(root: Path, recorded: Recorded) -> list[Case]:
    Checkout.make(ROOT, root, ())
    if not recorded.rollouts:
        shutil.rmtree(root / "robots/t1/policies/tracker")
    files, seconds = write_copies(recorded.folder, recorded.seconds, root / "data/motions")
    return [_case(root, files, seconds, ROLLED_OUT if recorded.rollouts else RECORDED)]


def _case(root: Path, clips: int, clip_seconds: float, scenario: str, changed: str = "") -> Case:
    environment = clean_environment(root, Path(sys.executable).parent)
    watched = watch(COMMAND, folder=root, environment=environment, log=root.with_suffix(".log"))
    run = read_run(root, watched, changed)
    print(f"{clips} clips, {scenario}: {run.wall_s:.1f} s", file=sys.stderr)
    return Case(clips=clips, clip_seconds=clip_seconds, scenario=scenario, run=run)


def bars(cases: list[Case]) -> list[Bar]:
    """All numbers over the repeats (medians, with the range of wall times), and their bounds."""
    found: list[Bar] = []
    for name in dict.fromkeys(case.name for case in cases):
        found += _bars_of([case for case in cases if case.name == name])
    found += _growth(cases)
    return found


def _bars_of(same: list[Case]) -> list[Bar]:
    """Bars of the repeats of one case."""
    first, runs = same[0], [case.run for case in same]
    walls = [run.wall_s for run in runs]
    most = MOST_UNCHANGED_S if UNCHANGED in first.scenario else MOST_SHIPPED_S if SHIPPED in first.scenario else None
    found = [
        Bar(name=f"{first.name}: wall time", value=_median(walls), unit="s", sense="<=", bound=most),
        Bar(name=f"{first.name}: spread of wall time", value=max(walls) - min(walls), unit="s"),
        Bar(name=f"{first.name}: processor time", value=_median(run.cpu_s for run in runs), unit="s"),
        Bar(name=f"{first.name}: peak memory, main process", value=_median(run.main_mb for run in runs), unit="MB"),
        Bar(name=f"{first.name}: peak memory, all processes", value=_median(run.tree_mb for run in runs), unit="MB"),
    ]
    if UNCHANGED in first.scenario:
        again = max(run.recomputed for run in runs)
        found.append(Bar(name=f"{first.name}: clips recomputed", value=again, sense="<=", bound=0))
    if ONE_CHANGED in first.scenario:
        more = max(run.unexpected for run in runs)
        found.append(Bar(name=f"{first.name}: clips recomputed but its own", value=more, sense="<=", bound=0))
    if first.scenario == COLD:
        arrived = 100.0 * min(run.arrived for run in runs) / first.clips
        name = f"{first.name}: clips with something in the database"
        found.append(Bar(name=name, value=arrived, unit="%", sense=">=", bound=LEAST_ARRIVED))
    if RECORDED in first.scenario:
        most = MOST_CPU_PER_SECOND if first.scenario == RECORDED else None
        name, unit = f"{first.name}: processor time of a second", "s per recorded second"
        cpu = _median(run.cpu_s for run in runs) / first.clip_seconds
        found.append(Bar(name=name, value=cpu, unit=unit, sense="<=", bound=most))
        hours = 40.0 * _median(walls) / first.clip_seconds
        most = MOST_HOURS_FOR_40 if first.scenario == RECORDED else None
        found.append(Bar(name=f"{first.name}: 40 h of it", value=hours, unit="h", sense="<=", bound=most))
    if COLD in first.scenario or RECORDED in first.scenario:
        found += [
            Bar(
                name=f"{first.name}: {stage}, {kind}",
                value=_median(getattr(run.stages[stage], field) for run in runs) / first.clip_seconds,
                unit="s per clip-second",
            )
            for stage in (*STAGES, BETWEEN)
            if all(stage in run.stages for run in runs)
            for kind, field in (("wall time", "seconds"), ("processor time", "cpu_s"))
        ]
    return found


def _growth(cases: list[Case]) -> list[Bar]:
    """Memory growth of the main process per clip, from the smallest to the largest size."""
    cold = [case for case in cases if case.scenario == COLD]
    sizes = sorted({case.clips for case in cold})
    if len(sizes) < 2:
        return []
    few, many = (_median(case.run.main_mb for case in cold if case.clips == size) for size in (sizes[0], sizes[-1]))
    return [
        Bar(
            name=f"main process from {sizes[0]} to {sizes[-1]} clips",
            value=(many - few) / (sizes[-1] - sizes[0]),
            unit="MB a clip",
            sense="<=",
            bound=MOST_MAIN_MB_PER_CLIP,
        )
    ]


def print_stages(case: Case) -> None:
    """Print one row per stage."""
    print(f"\n{case.name}: {case.clip_seconds:.0f} s of motion, {case.run.wall_s:.1f} s, {case.run.cpu_s:.1f} s of CPU")
    print(
        f"{'':20} {'s':>8} {'s / clip-s':>11} {'CPU s':>8} {'/ clip-s':>9} {'recomputed':>11} {'main MB':>8} "
        f"{'tree MB':>8}"
    )
    for name in (*STAGES, BETWEEN):
        stage = case.run.stages.get(name)
        if stage is not None:
            again = "" if stage.recomputed is None else str(stage.recomputed)
            per_second = stage.seconds / case.clip_seconds
            memory = f"{stage.main_mb:8.0f} {stage.tree_mb:8.0f}"
            cpu = f"{stage.cpu_s:8.2f} {stage.cpu_s / case.clip_seconds:9.4f}"
            print(f"{name:20} {stage.seconds:8.2f} {per_second:11.4f} {cpu} {again:>11} {memory}")


def _median(values) -> float:
    return float(statistics.median(values))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=lambda text: [int(each) for each in text.split(",") if each], default=[10, 100])
    parser.add_argument("--repeat", type=int, default=1, help="all of it so many times")
    parser.add_argument(
        "--shipped", action=argparse.BooleanOptionalAction, default=True, help="the shipped motions, too"
    )
    parser.add_argument("--recordings", type=Path, help="a folder of BVH files, of which copies are worked on instead")
    parser.add_argument("--minutes", type=float, default=60.0, help="length of the copies together")
    parser.add_argument(
        "--rollouts", action=argparse.BooleanOptionalAction, default=True, help="roll out the recordings' references"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object instead of tables")
    parser.add_argument("--keep", type=Path, help="leave the checkouts and their logs in this folder")
    return parser.parse_args()


if __name__ == "__main__":
    main()
