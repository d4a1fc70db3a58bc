"""Overhead of a run beyond the processing of clips, for 100, 1,000 and 10,000 clips.

    python benchmarks/scale.py [--sizes 100,1000,10000] [--workers 2] [--json] [--keep FOLDER]

The clips are as cheap as possible: 0.1 s of a standing T1, which each stage changes slightly. The overhead is memo
look-ups, distribution to processes, manifests, weights, and the database. Each size runs in separate processes: cold,
without changes, and with one more clip. Time is CPU time of all processes; memory is the peak resident memory of the
main process, including imports.
"""

from __future__ import annotations

import argparse
import dataclasses
import logging
import resource
import shutil
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline.batch import ClipPool, Manifest, Stage, Store, run_files, run_stage  # noqa: E402
from pipeline.clips.outcome import Outcome, Piece  # noqa: E402
from pipeline.clips.robot_clip import RobotClip  # noqa: E402
from pipeline.expert import ExpertEntry, StoredClip, write_database  # noqa: E402
from pipeline.expert.index import database_version  # noqa: E402
from pipeline.feasibility import CommandSettings, FeasibilitySettings, balance  # noqa: E402
from pipeline.feasibility.balance import READ  # noqa: E402
from pipeline.feasibility.command_space import VELOCITIES  # noqa: E402
from pipeline.files import digest, settings  # noqa: E402
from pipeline.robot import load_robot  # noqa: E402
from tests.factories.robot_clips import standing  # noqa: E402

STAGES = ("selected", "repaired", "retargeted", "variants", "references", "feasible")
COLD, UNCHANGED, ONE_MORE = "cold", "unchanged", "one more"
SECONDS = 0.1
"""Length of a clip [s]."""
NUMBERS = 12
"""Numbers that each stage adds to a clip, the average of the real stages."""

MOST_MAIN_MB = 1500.0
MOST_UNCHANGED_S = 20.0
MOST_ONE_MORE_S = 40.0
MOST_RATIO = 3.0
"""Largest ratio of the cost per added clip between the largest and the smallest size."""


def read_clip(path: Path, name: str, number: int, clip: RobotClip) -> Outcome:
    """The clip with a number, shifted so that no two have the same bytes."""
    moved = dataclasses.replace(clip, name=name, root_pos_w=clip.root_pos_w + np.array([0.001 * number, 0.0, 0.0]))
    numbers = {"seconds": clip.duration_s, "source": f"source{number % 20}", "licence": "CC0-1.0", "skill": "stand"}
    return Outcome(pieces=(Piece(clip=moved, numbers={**numbers, "number": number}),))


def pass_on(clip: RobotClip, numbers: dict, *, stage: str) -> Outcome:
    """A stage: lift the clip by a micrometre and add numbers."""
    lifted = dataclasses.replace(clip, root_pos_w=clip.root_pos_w + np.array([0.0, 0.0, 1e-6]))
    number = int(numbers["number"])
    own = {f"{stage}_{index}": (number * 7 + index) / 1000.0 for index in range(NUMBERS)}
    if stage == STAGES[-1]:
        own |= {name: 0.1 * ((number >> 3 * axis) % 8) for axis, name in enumerate(VELOCITIES)}
        own["root_jerk"] = 1.0
    return Outcome(pieces=(Piece(clip=lifted, numbers=own),))


def run(root: Path, count: int, workers: int) -> None:
    """Run the chain over `count` clips: every stage, weights, and the database if anything changed."""
    store, pool, log = Store(root=root / "store"), ClipPool(workers=workers), logging.getLogger()
    robot = load_robot(ROOT / "robots/t1")
    clip = standing(robot, seconds=SECONDS)
    files = [(f"source{n % 20}/clip{n:05d}", ROOT / "README.md", digest.of_json(n), (n, clip)) for n in range(count)]
    manifest = run_files(Stage(name="catalog", version="1", function=read_clip), files, store, pool, log)
    store.save("catalog", manifest)
    for name in STAGES:
        stage = Stage(name=name, version="1", function=partial(pass_on, stage=name))
        manifest = run_stage(stage, store.load(manifest.stage), store, pool, log)
        if name == STAGES[-1]:
            assert not [*store.damaged(manifest, pool)]
            manifest = weighed(manifest)
        store.save(name, manifest)
    write_database(
        root / "t1", database_entries(store, manifest), robot, stages=manifest.settings, pool=ClipPool(workers=workers)
    )


def weighed(manifest: Manifest) -> Manifest:
    """The manifest with the weight of each clip."""
    values = settings.read(ROOT / "data/feasibility.yaml", FeasibilitySettings)
    commands = settings.read(ROOT / "data/commands.yaml", CommandSettings)
    made = balance(manifest.entry_table(READ), values.balance, commands)
    numbers = zip(made["clip"], made["weight"], strict=True)
    return manifest.with_numbers({clip: {"weight": float(weight)} for clip, weight in numbers})


def database_entries(store: Store, manifest: Manifest):
    """Entries of the database, each with its clip's name in the store."""
    for entry in manifest.entries:
        yield ExpertEntry(
            clip=StoredClip(name=entry.clip, blob=entry.blob, store=store),
            weight=entry.numbers["weight"],
            skill=entry.numbers["skill"],
            licence=entry.numbers["licence"],
            numbers=entry.numbers,
            stages={"stages": list(entry.record)},
        )


def look(root: Path) -> None:
    """Check, as a run without stale assets does, that all blobs, manifests and database files are unchanged."""
    store = Store(root=root / "store")
    for name in ("catalog", *STAGES):
        assert store.holds_blobs_of(name) and digest.of_file(store.manifest_path(name))
    store.note_blobs()
    database_version(root / "t1")


def step(root: Path, scenario: str, count: int, workers: int) -> tuple[float, float]:
    """CPU time of a scenario in a separate process [s], and the peak memory of its main process [MB]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, __file__, "--step", scenario, str(root), str(count), "--workers", str(workers)]
    made = subprocess.run(command, check=True, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, float(made.stdout.split()[-1])


def measure(folder: Path, sizes: list[int], workers: int) -> list[Bar]:
    bars, one_more = [], {}
    for size in sizes:
        root = folder / str(size)
        shutil.rmtree(root, ignore_errors=True)
        found = {}
        for scenario, count in ((COLD, size), (UNCHANGED, size), (ONE_MORE, size + 1)):
            found[scenario] = step(root, scenario, count, workers)
            print(f"{size} clips, {scenario}: {found[scenario][0]:.1f} s, {found[scenario][1]:.0f} MB", file=sys.stderr)
        one_more[size] = found[ONE_MORE][0]
        last = size == max(sizes)
        for scenario, most in ((COLD, None), (UNCHANGED, MOST_UNCHANGED_S), (ONE_MORE, MOST_ONE_MORE_S)):
            name = f"{size} clips, {scenario}"
            bars.append(_bar(f"{name}: processor time", found[scenario][0], "s", most if last else None))
            bars.append(_bar(f"{name}: main process", found[scenario][1], "MB", MOST_MAIN_MB if last else None))
    if len(sizes) > 1:
        ratio = max(one_more.values()) / min(one_more.values())
        bars.append(_bar("one more clip, the dearest size over the cheapest", ratio, "", MOST_RATIO))
    return bars


def _bar(name: str, value: float, unit: str, bound: float | None) -> Bar:
    return Bar(name=name, value=value, unit=unit, sense="<=", bound=bound)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--sizes", type=lambda text: [int(each) for each in text.split(",")], default=[100, 1000, 10000]
    )
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--json", action="store_true", help="one JSON object instead of a table")
    parser.add_argument("--keep", type=Path, help="leave the stores and databases in this folder")
    parser.add_argument("--step", nargs=3, metavar=("SCENARIO", "FOLDER", "COUNT"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.step:
        scenario, root, count = given.step
        look(Path(root)) if scenario == UNCHANGED else run(Path(root), int(count), given.workers)
        print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3)
        return
    folder = given.keep or Path(tempfile.mkdtemp(prefix="booster_lab_scale_"))
    try:
        bars = measure(folder, given.sizes, given.workers)
    finally:
        if given.keep is None:
            shutil.rmtree(folder)
    sys.exit(0 if report(bars, machine=machine(), json=given.json) else 1)


if __name__ == "__main__":
    main()
