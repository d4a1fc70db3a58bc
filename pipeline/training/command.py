"""The arguments of `python -m pipeline.training`, and the run that they ask for."""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.learning.arguments import chosen_device, pairs
from pipeline.learning.training_error import TrainingError
from pipeline.training.option_texts import changed_by_texts
from pipeline.training.presets import DEFAULT, PRESETS, preset


def main(arguments: Sequence[str]) -> int:
    """Train; exit status 0, 2 for a wrong request, 130 when interrupted."""
    given = _parser().parse_args(arguments)
    if given.list:
        print(json.dumps({name: [text, dataclasses.asdict(each)] for name, (text, each) in PRESETS.items()}, indent=1))
        return 0
    try:
        _train(given)
    except TrainingError as error:
        print(error, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted; --resume goes on from the newest checkpoint.", file=sys.stderr)
        return 130
    return 0


def _train(given: argparse.Namespace) -> None:
    from pipeline.training.bundle import read_bundle  # mjlab takes seconds to import; wrong arguments are told at once
    from pipeline.training.run import RunRequest, TrainingRun

    if given.bundle is None or given.out is None:
        raise TrainingError("--bundle and --out are needed; python -m pipeline.training --help tells more.")
    options = changed_by_texts(preset(given.preset), pairs(given.set))
    bundle = read_bundle(given.bundle, options.use_augmented)
    request = RunRequest(
        out=given.out,
        preset=given.preset,
        options=options,
        num_envs=given.num_envs,
        device=chosen_device(given.device),
        seed=given.seed,
        iterations=given.iterations,
        minutes=given.minutes,
        resume=given.resume,
        physics=given.physics,
        start_from=given.start_from,
    )
    TrainingRun(bundle, request).train()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m pipeline.training", description="Train a policy; see the module's text."
    )
    parser.add_argument("--bundle", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--preset", default=DEFAULT)
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--physics", choices=("warp", "plain"))
    parser.add_argument("--start-from", type=Path, metavar="POLICY")
    parser.add_argument("--num-envs", type=int, default=4096)
    parser.add_argument("--iterations", type=int, default=1500)
    parser.add_argument("--minutes", type=float)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("--list", action="store_true")
    return parser
