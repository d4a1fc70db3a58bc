"""Throughput of a Dask cluster of two workers on this machine against two processes of `loky`.

    python benchmarks/cluster.py [--clips 120] [--seconds 8] [--repeat 5] [--json]

Both evaluate the same clips with KP5, alternately, each time into an empty store, with processes that have already
loaded the robot. The threshold applies to the ratio of the medians.
"""

from __future__ import annotations

import argparse
import logging
import statistics
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline.batch import ClipPool, Entry, Manifest, Stage, Store, run_stage  # noqa: E402
from pipeline.feasibility import FeasibilitySettings, process  # noqa: E402
from pipeline.files import settings  # noqa: E402
from pipeline.robot import Robot, load_robot  # noqa: E402
from tests.factories.robot_clips import wandering  # noqa: E402

WORKERS = 2
WARM_UP = 16
"""Clips evaluated before the measurement."""
LEAST_RATIO = 0.8
"""Least throughput of the cluster relative to `loky`."""


def seconds_of(stage: Stage, robot: Robot, pool: ClipPool, clips: int, clip_s: float) -> tuple[float, str]:
    """Wall time of the stage for the clips [s], and the digest of its results."""
    with tempfile.TemporaryDirectory(prefix="booster_lab_cluster_") as folder:
        store, entries = Store(root=Path(folder)), []
        for seed in range(clips):
            blob = store.put_clip(wandering(robot, seconds=clip_s, seed=seed))
            entries.append(Entry(clip=f"clip{seed:04d}", blob=blob, numbers={"seconds": clip_s}))
        before = Manifest(stage="before", entries=tuple(entries), judged=())
        started = time.perf_counter()
        made = run_stage(stage, before, store, pool, logging.getLogger())
        return time.perf_counter() - started, made.digest


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clips", type=int, default=120)
    parser.add_argument("--seconds", type=float, default=8.0, help="length of a clip")
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--json", action="store_true", help="one JSON object instead of a table")
    given = parser.parse_args()
    robot = load_robot(ROOT / "robots/t1")
    values = settings.read(ROOT / "data/feasibility.yaml", FeasibilitySettings)
    stage = Stage(name="evaluated", version="1", function=partial(process, settings=values, robot=robot))
    pools = {name: ClipPool(backend=name, workers=WORKERS) for name in ("loky", "dask")}
    for pool in pools.values():
        seconds_of(stage, robot, pool, WARM_UP, given.seconds)
    times: dict[str, list[float]] = {name: [] for name in pools}
    digests = set()
    for _ in range(given.repeat):
        for name, pool in pools.items():
            wall_s, found = seconds_of(stage, robot, pool, given.clips, given.seconds)
            times[name].append(wall_s)
            digests.add(found)
    median = {name: statistics.median(walls) for name, walls in times.items()}
    bars = [Bar(name=f"{name}: {given.clips} clips of KP5", value=wall, unit="s") for name, wall in median.items()]
    ratio = median["loky"] / median["dask"]
    bars.append(Bar(name="throughput of dask over loky", value=ratio, sense=">=", bound=LEAST_RATIO))
    bars.append(Bar(name="different results", value=len(digests) - 1, sense="<=", bound=0))
    sys.exit(0 if report(bars, machine=machine(), json=given.json) else 1)


if __name__ == "__main__":
    main()
