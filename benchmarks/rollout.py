"""Speed of CPU rollouts: seconds of motion a second of wall time, observations, network and recording included.

    python -m benchmarks.rollout [--workers 2] [--repeats 3]

Rolls out every fourth reference of `reference_motions` without disturbance, on all workers. Needs `expert_db`
materialized.
"""

from __future__ import annotations

import argparse
import os
import time
from statistics import median

from assets.plan import named_plans
from assets.project import DEFAULT_ROBOT, PROJECT
from pipeline.actuators import read_actuators, torque_envelope
from pipeline.batch.pool import ClipPool
from pipeline.clips.robot_clip import RobotClip
from pipeline.files import settings
from pipeline.robot import load_robot
from pipeline.tracking.evaluate import figures, nominal_rollouts
from pipeline.tracking.settings import TrackingSettings

EVERY = 4


def main() -> None:
    """Print speed (median and range of the repeats) and the figures of the rollouts."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--robot", default=DEFAULT_ROBOT)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=3)
    given = parser.parse_args()
    plans, folder = named_plans(given.robot), PROJECT.adapted_robot(given.robot)
    manifest = PROJECT.store.load(plans["reference_motions"].key.to_user_string())
    clips = [PROJECT.store.get_clip(entry.blob, entry.clip) for entry in manifest.entries[::EVERY]]
    motions = [clip for clip in clips if isinstance(clip, RobotClip)]
    (facts,) = PROJECT.store.load(plans["tracking_policy"].key.to_user_string()).settings.values()
    asked = (
        motions,
        load_robot(folder),
        torque_envelope(read_actuators(folder)),
        PROJECT.root / facts["folder"] / "tracker.npz",
        settings.read(PROJECT.settings("tracking.yaml"), TrackingSettings),
        ClipPool(workers=given.workers),
    )
    found = nominal_rollouts(*asked)  # workers start and import
    seconds = sum(clip.duration_s for clip in motions)
    speeds = []
    for _ in range(given.repeats):
        started = time.perf_counter()
        found = nominal_rollouts(*asked)
        speeds.append(seconds / (time.perf_counter() - started))
    print(f"{len(motions)} clips, {seconds:.0f} s, {given.workers} workers on {os.cpu_count()} cores")
    print(f"{median(speeds):.1f} x real time ({min(speeds):.1f} to {max(speeds):.1f})")
    print(", ".join(f"{name} {value:g}" for name, value in figures(found).items()))


if __name__ == "__main__":
    main()
