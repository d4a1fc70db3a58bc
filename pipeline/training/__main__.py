"""Train a walking policy and validate it: `python -m pipeline.training --out DIR`.

    --bundle DIR        robot, expert frames and tracker as plain files, written by the asset amp_policy
                        (default: data/policies/t1/bundle)
    --out DIR           folder of the run
    --preset NAME       `recipe` (the default) or `paper`
    --set NAME=VALUE    change one option, as `schedule.iterations=1000`; may be repeated (`--list` prints all options)
    --device cuda|cpu   or `cuda:1`; `cuda` without a GPU is an error. A CPU trains only distillation by default; add
                        `--set simulation.num_envs=64` there
    --stages NAME ...   stages to run: `distillation`, `amp`, `validation` (default: all; on a CPU all but `amp`)
    --physics plain|warp  MuJoCo in threads (the default on a CPU), or MuJoCo Warp (on a GPU)
    --seed S            random seed (default: 1)
    --list              print all options with their values in both presets, units and sources, and exit

Repeating the command continues from the newest checkpoint; `chain.py` lists the files. Each iteration prints a line:
`iteration 12 of 5800 of amp, 5 s, 46.9 min left: ...`. Exit status: 0 when done, 2 for wrong arguments or files, 130
when interrupted. Several GPUs: `torchrun --nproc-per-node 4 -m pipeline.training ...`, each with `simulation.num_envs`.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # PyTorch threads must not spin while MuJoCo threads work

from pipeline.learning.run_command import chosen_device, exit_status, pairs
from pipeline.learning.training_error import TrainingError
from pipeline.training.config import DEFAULT, PAPER, RECIPE, changed_by_texts, preset

NO_MEMORY = ("out of memory", "Failed to allocate", "can't allocate memory", "ALLOC_FAILED")
"""Substrings of the RuntimeErrors that PyTorch and Warp raise when out of memory."""
MAX_SEED = 2**31 - 1
"""NumPy requires seeds below 2^32, and each process adds 1000 times its rank."""


def main(arguments: Sequence[str]) -> int:
    """Train; return the exit status."""
    args = _parser().parse_args(arguments)
    if args.list:
        print(options_table())
        return 0
    return exit_status(lambda: _train(args), "repeating the command continues from the newest checkpoint.")


def _train(args: argparse.Namespace) -> None:
    if args.out is None:
        raise TrainingError("--out is required; see python -m pipeline.training --help.")
    if not 0 <= args.seed <= MAX_SEED:
        raise TrainingError(f"--seed is {args.seed}; 0 to {MAX_SEED} is allowed.")
    config = changed_by_texts(preset(args.preset), pairs(args.set))
    device = chosen_device(args.device)
    from pipeline.training.bundle import read_bundle  # mjlab takes seconds to import
    from pipeline.training.chain import stages_of, train
    from pipeline.training.stage import Request

    request = Request(
        out=args.out, preset=args.preset, config=config, device=device, seed=args.seed, physics=args.physics
    )
    stages = stages_of(request, args.stages)
    bundle = read_bundle(args.bundle, config.discriminator.use_augmented)
    try:
        train(bundle, request, stages)
    except (MemoryError, RuntimeError) as error:
        if not isinstance(error, MemoryError) and not any(text in str(error) for text in NO_MEMORY):
            raise
        raise TrainingError(
            f"{config.simulation.num_envs} environments need more memory than is free on '{device}'. End other jobs "
            "there, or lower simulation.num_envs and give another --out."
        ) from error


def options_table() -> str:
    """Every option: its name, value in the recipe and in the paper, unit, meaning and source."""
    paper = PAPER.values()
    rows = [("option", "recipe", "paper", "unit", "meaning", "source")]
    rows += [
        (name, str(value), str(paper[name]), facts["unit"], facts["text"], facts["source"])
        for name, value, facts in RECIPE.options()
    ]
    widths = [*(max(len(row[column]) for row in rows) for column in range(5)), 0]
    return "\n".join("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)) for row in rows)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m pipeline.training", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bundle", type=Path, default=Path("data/policies/t1/bundle"))
    parser.add_argument("--out", type=Path)
    parser.add_argument("--preset", default=DEFAULT)
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--stages", nargs="+", choices=("distillation", "amp", "validation"))
    parser.add_argument("--physics", choices=("warp", "plain"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--list", action="store_true")
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
