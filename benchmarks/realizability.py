"""Can a classifier distinguish expert motions from the robot in simulation? References compared with rollouts.

    python -m benchmarks.realizability [--seeds 3]

Held-out accuracy of a small network (pipeline/expert/realizability.py) between windows of the stored motions and
windows of rollouts of the same references under other seeds, families held out. 0.5 is chance. Needs `expert_db`
materialized.
"""

from __future__ import annotations

import argparse
import logging

import numpy as np

from assets.database_checks import held_out_accuracy
from assets.plan import robot_plans
from pipeline.batch.pool import ClipPool
from pipeline.project import DEFAULT_ROBOT, PROJECT


def main() -> None:
    """Print the accuracy for references, for all rollouts and for the clips of KP5, over some seeds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default=DEFAULT_ROBOT)
    parser.add_argument("--seeds", type=int, default=3)
    given = parser.parse_args()
    plans = robot_plans(given.robot)
    for name in ("reference_motions", "augmented_motions", "feasible_motions"):
        manifest = PROJECT.store.load(plans[name].key.to_user_string())
        log = logging.getLogger()
        values = [held_out_accuracy(given.robot, manifest, ClipPool(), log, seed) for seed in range(given.seeds)]
        print(f"{name:20} accuracy {np.mean(values):.3f} ({min(values):.3f} to {max(values):.3f})")


if __name__ == "__main__":
    main()
