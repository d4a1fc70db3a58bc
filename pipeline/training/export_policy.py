"""A checkpoint as a policy: `python -m pipeline.training.export_policy --checkpoint FILE --bundle DIR --out FILE`."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.learning.checkpoint import load_checkpoint
from pipeline.learning.policy_file import policy_arrays, write_policy
from pipeline.learning.robot_facts import read_robot_facts
from pipeline.learning.training_error import TrainingError


def main(arguments: Sequence[str]) -> int:
    """Exit status 0, or 2 with the error on stderr."""
    parser = argparse.ArgumentParser(prog="python -m pipeline.training.export_policy", description=__doc__)
    for name in ("checkpoint", "bundle", "out"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    given = parser.parse_args(arguments)
    try:
        robot = read_robot_facts(given.bundle)
        write_policy(given.out, policy_arrays(load_checkpoint(given.checkpoint, "cpu"), robot))
    except TrainingError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
