"""Speed of CPU rollouts: seconds of motion per second of wall time, including observations, network and recording.

    python -m benchmarks.rollout [--workers 2] [--repeats 3] [--every 4]

Rolls out every fourth reference of `reference_motions` without disturbance, on all workers, and prints how well the
tracker follows trained and held-out references (files in `excluded_clips` of data/curation.yaml at training time).
Needs a materialized `expert_db`.
"""

from __future__ import annotations

import argparse
import os
import time
from functools import partial
from statistics import median

from assets.plan import robot_plans
from pipeline.actuators.adapted_robot import read_actuators, torque_envelope
from pipeline.batch.pool import ClipPool
from pipeline.clips.robot_clip import RobotClip
from pipeline.project import DEFAULT_ROBOT, PROJECT
from pipeline.robot import load_robot
from pipeline.tracking.nominal_rollout import figures, nominal_rollout
from pipeline.tracking.process import Setup
from pipeline.tracking.settings import TrackingSettings
from pipeline.tracking.tracker_folder import NETWORK, read_card


def main() -> None:
    """Print speed (median and range of the repeats) and the metrics of the rollouts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default=DEFAULT_ROBOT)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--every", type=int, default=4)
    given = parser.parse_args()
    plans, folder = robot_plans(given.robot), PROJECT.adapted_robot(given.robot)
    manifest = PROJECT.store.load(plans["reference_motions"].key.to_user_string())
    clips = [PROJECT.store.get_clip(entry.blob, entry.clip) for entry in manifest.entries[:: given.every]]
    motions = [clip for clip in clips if isinstance(clip, RobotClip)]
    (facts,) = PROJECT.store.load(plans["tracking_policy"].key.to_user_string()).settings.values()
    tracker = PROJECT.root / facts["folder"]
    trained_on = set(read_card(tracker).clips)
    setup = Setup(
        settings=PROJECT.read("tracking.yaml", TrackingSettings),
        robot=load_robot(folder),
        envelope=torque_envelope(read_actuators(folder)),
        tracker=tracker / NETWORK,
    )
    asked = partial(nominal_rollout, setup=setup), [(clip,) for clip in motions]
    pool = ClipPool(workers=given.workers)
    found = list(pool.map(*asked))  # warm-up: workers start and import
    seconds = sum(clip.duration_s for clip in motions)
    speeds = []
    for _ in range(given.repeats):
        started = time.perf_counter()
        found = list(pool.map(*asked))
        speeds.append(seconds / (time.perf_counter() - started))
    print(f"{len(motions)} clips, {seconds:.0f} s, {given.workers} workers on {os.cpu_count()} cores")
    print(f"{median(speeds):.1f} x real time ({min(speeds):.1f} to {max(speeds):.1f})")
    for known, name in ((True, "trained on"), (False, "not trained on")):
        part = [each for each in found if (each.clip in trained_on) == known]
        if part:
            print(f"{name}: {', '.join(f'{figure} {value:g}' for figure, value in figures(part).items())}")


if __name__ == "__main__":
    main()
