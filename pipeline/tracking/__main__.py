"""Train a tracker: `python -m pipeline.tracking --bundle DIR --out DIR`.

Written below `--out`: `config.json` (settings, digests, versions), `curves.csv` (one row per iteration),
`checkpoints/model_000100.pt` (every 100 iterations and the last, read with `weights_only=True`), `tracker.npz` (the
newest network, as rollouts read it) and, at the end, `done.json`.

Several GPUs: `torchrun --nproc-per-node 2 -m pipeline.tracking ...`; `--num-envs` is per GPU.
Exit status: 0 when done, 2 for wrong arguments or files, 130 when interrupted.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # torch's threads must not spin while MuJoCo's threads work

from pipeline.learning.run_command import chosen_device, exit_status
from pipeline.tracking.bundle import read_tracking_bundle
from pipeline.tracking.task import ITERATIONS


def main(arguments: Sequence[str]) -> int:
    """Train a tracker; the exit status."""
    given = _parser().parse_args(arguments)
    return exit_status(lambda: _train(given), "--resume continues from the newest checkpoint.")


def _train(given: argparse.Namespace) -> None:
    bundle, device = read_tracking_bundle(given.bundle), chosen_device(given.device)
    from pipeline.tracking.run import TrackingRequest, TrackingRun  # torch and mjlab take seconds to import

    names = ("out", "num_envs", "seed", "iterations", "minutes", "resume")
    request = TrackingRequest(device=device, **{name: getattr(given, name) for name in names})
    TrackingRun(bundle, request).train()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m pipeline.tracking", description=__doc__)
    bundle = "robot and reference motions as plain files; the job `train_tracker` writes them"
    parser.add_argument("--bundle", type=Path, required=True, help=bundle)
    parser.add_argument("--out", type=Path, required=True, help="folder of the run")
    parser.add_argument("--device", default="cuda", help="cuda, cuda:1 or cpu; cuda without a GPU is an error")
    parser.add_argument("--num-envs", type=int, default=4096, help="environments of each GPU")
    counted = "of 24 control steps; with --resume counted from the beginning of the run"
    parser.add_argument("--iterations", type=int, default=ITERATIONS, help=counted)
    parser.add_argument("--minutes", type=float, help="end after this training time, that before a resume included")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--resume", action="store_true", help="continue from the newest checkpoint, if there is one")
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
