"""`python -m pipeline.training.export_policy --checkpoint FILE --bundle DIR --out FILE`: a checkpoint as a policy.

Given several checkpoints of one run, the policy is the mean of their networks, which walks steadier than any of them
while the learning rate is high (as averaged iterates of stochastic gradients do: Polyak and Juditsky 1992).

`--towards POLICY.npz --share .1` takes a tenth of its network from the policy that the run went on from: what training
on took from that one comes back before what it brought is lost.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.learning.checkpoint import load_checkpoint
from pipeline.learning.policy_file import mean_arrays, policy_arrays, write_policy
from pipeline.learning.training_error import TrainingError
from pipeline.training.bundle import read_bundle
from pipeline.training.given_network import moved_towards


def main(arguments: Sequence[str]) -> int:
    """Exit status 0, or 2 with the error on stderr."""
    parser = argparse.ArgumentParser(prog="python -m pipeline.training.export_policy", description=__doc__)
    parser.add_argument("--checkpoint", type=Path, required=True, action="append")
    parser.add_argument("--towards", type=Path, metavar="POLICY")
    parser.add_argument("--share", type=float, default=0.0)
    for name in ("bundle", "out"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    given = parser.parse_args(arguments)
    try:
        if (given.towards is None) != (given.share == 0.0):
            raise TrainingError(f"--share is {given.share:g} and --towards {given.towards}: give both or neither.")
        robot = read_bundle(given.bundle).robot
        policy = mean_arrays([policy_arrays(load_checkpoint(path, "cpu"), robot) for path in given.checkpoint])
        if given.towards is not None:
            policy = moved_towards(policy, given.towards, given.share, robot)
        write_policy(given.out, policy)
    except TrainingError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
