"""A weighted sum of networks: `python -m pipeline.training.mix_policies --out FILE --part WEIGHT POLICY.npz …`.

Weights sum to 1 and may be negative: away from a network as well as towards it. Normalizer and layers are summed in the
order given; gains and joints are the first one's, and must be everyone's. Networks that were trained on from one start
lie near enough for their sums to walk (Wortsman et al., "Model soups", ICML 2022; beyond 0 and 1: Ilharco et al.,
"Editing models with task arithmetic", ICLR 2023). Which of them walks well only a validation tells.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipeline.learning.policy_file import summed_names, weighted_sum, write_policy
from pipeline.learning.training_error import TrainingError
from pipeline.training.given_network import GAINS, arrays_of

Part = tuple[float, Path]
"""A weight and the file of a policy."""


def mixed(parts: Sequence[Part]) -> dict[str, np.ndarray]:
    """The arrays of the weighted sum.

    Raises TrainingError for weights that don't sum to 1 and for policies unlike the first.
    """
    total = math.fsum(weight for weight, _ in parts)
    if not math.isclose(total, 1.0, abs_tol=1e-6):
        raise TrainingError(f"the weights sum to {total:g}; they must sum to 1.")
    each = [arrays_of(path) for _, path in parts]
    first, first_path = each[0], parts[0][1]
    if not summed_names(first):
        raise TrainingError(f"{first_path}: has no layers; name the npz of a policy.")
    for (_, path), arrays in zip(parts[1:], each[1:], strict=True):
        _hold_to_first(path, arrays, first_path, first)
    found = weighted_sum([(weight, arrays) for (weight, _), arrays in zip(parts, each, strict=True)])
    if "std" in found and not (found["std"] > 0.0).all():
        raise TrainingError("a deviation of the normalizer comes to 0 or less; take weights nearer to 0 and 1.")
    return found


def _hold_to_first(path: Path, arrays: dict[str, np.ndarray], first_path: Path, first: dict[str, np.ndarray]) -> None:
    if set(arrays) != set(first):
        names = ", ".join(sorted(set(arrays) ^ set(first)))
        raise TrainingError(
            f"{path}: differs from {first_path} in which arrays it has: {names}; take one of that network."
        )
    for name, value in first.items():
        if arrays[name].shape != value.shape:
            raise TrainingError(
                f"{path}: '{name}' is {arrays[name].shape}, in {first_path} {value.shape}; take one of that network."
            )
    for name in ("eps", "joint_names", *GAINS):
        if name in first and not np.array_equal(arrays[name], first[name]):
            raise TrainingError(
                f"{path}: '{name}' differs from that of {first_path}; take one of that robot and gains."
            )


def main(arguments: Sequence[str]) -> int:
    """Exit status 0, or 2 with the error on stderr."""
    parser = argparse.ArgumentParser(prog="python -m pipeline.training.mix_policies", description=__doc__)
    parser.add_argument("--part", nargs=2, action="append", required=True, metavar=("WEIGHT", "POLICY"))
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args(arguments)
    try:
        write_policy(given.out, mixed([(_weight(weight), Path(path)) for weight, path in given.part]))
    except TrainingError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def _weight(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise TrainingError(f"--part {text}: a weight must be a number, as in --part .9 policy.npz.")
    return value


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
