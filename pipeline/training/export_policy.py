"""`python -m pipeline.training.export_policy --checkpoint FILE --bundle DIR --out FILE`: a checkpoint as a policy.

Given several checkpoints of one run, the policy is the mean of their networks, which walks steadier than any of them
while the learning rate is high (as averaged iterates of stochastic gradients do: Polyak and Juditsky 1992).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.training.bundle import read_bundle
from pipeline.training.checkpoint import load_checkpoint
from pipeline.training.policy_file import mean_arrays, policy_arrays, write_policy
from pipeline.training.training_error import TrainingError


def main(arguments: Sequence[str]) -> int:
    """Exit status 0, or 2 with the error on stderr."""
    parser = argparse.ArgumentParser(prog="python -m pipeline.training.export_policy", description=__doc__)
    parser.add_argument("--checkpoint", type=Path, required=True, action="append")
    for name in ("bundle", "out"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    given = parser.parse_args(arguments)
    try:
        robot = read_bundle(given.bundle).robot
        write_policy(
            given.out, mean_arrays([policy_arrays(load_checkpoint(path, "cpu"), robot) for path in given.checkpoint])
        )
    except TrainingError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
