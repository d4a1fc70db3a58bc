"""`python -m pipeline.training.export_policy --checkpoint FILE --bundle DIR --out FILE`: a checkpoint as a policy."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.training.bundle import read_bundle
from pipeline.training.checkpoint import load_checkpoint
from pipeline.training.policy_file import policy_arrays, write_policy
from pipeline.training.training_error import TrainingError


def main(arguments: Sequence[str]) -> int:
    """Exit status 0, or 2 with the error on stderr."""
    parser = argparse.ArgumentParser(prog="python -m pipeline.training.export_policy", description=__doc__)
    for name in ("checkpoint", "bundle", "out"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    given = parser.parse_args(arguments)
    try:
        state = load_checkpoint(given.checkpoint, "cpu")
        write_policy(given.out, policy_arrays(state, read_bundle(given.bundle).robot))
    except TrainingError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
