"""Several training runs side by side, swept while they train, chosen, measured and packed: what a borrowed host does.

    python -m pipeline.training.train_arms run --bundle DIR --out DIR --pack DIR --preset NAME --seeds 1 2 3 [--detach]
    python -m pipeline.training.train_arms wait --out DIR [--seconds S]      status lines until it is done, or S is over
    python -m pipeline.training.train_arms status --out DIR                  the same once
    python -m pipeline.training.train_arms stop --out DIR                    interrupts it; what is there is packed

`run` trains one arm a GPU (several share one where there are more arms), `--minutes` each. Every checkpoint from
`--first` iterations on is walked in plain MuJoCo on `--workers` processes while training goes on, so are means of the
last checkpoints; per arm the one of the lowest score is its policy, and is measured anew with other starts and pushes.
Started again, it goes on: runs from their newest checkpoint, sweeps where they were. A run that breaks off is taken up
twice. `--pack` gets what must come back, after each sweep and at the end: at most 8 files of 16 MiB
(`pipeline/training/arm_pack.py`). `--detach` lets it live on alone: its text goes to `OUT/log.txt`.

    --seeds S …                      an arm `seed<S>` each
    --arm NAME SEED [NAME=VALUE …]   an arm of its own options; may be given often
    --start-from FILE                a policy file that all arms go on from
    --set NAME=VALUE                 an option of all arms; may be given often
    --device cuda|cpu, --gpus N      N: how many to use; as many as there are where it isn't given
    --num-envs, --iterations, --minutes   of each run, as `python -m pipeline.training` takes them
    --sweep full|brief               `brief` walks a few seconds, to see that it works

Exit status 0 when every arm has a policy, 1 when one has none, 2 for wrong arguments or files.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from pipeline.learning.training_error import TrainingError
from pipeline.training.presets import DEFAULT

SWEEPS = ("full", "brief")


def main(arguments: Sequence[str]) -> int:
    """Do what is asked; the exit status."""
    given = _parser().parse_args(arguments)
    try:
        if given.verb == "run":
            return _run(given, arguments)
        if given.verb == "wait":
            return _wait(given.out, given.seconds, given.every)
        if given.verb == "stop":
            return _stop(given.out)
        print(status_text(given.out), flush=True)
        return 0
    except TrainingError as error:
        print(error, file=sys.stderr)
        return 2


def _run(given: argparse.Namespace, arguments: Sequence[str]) -> int:
    from pipeline.training.arms import Arm, ArmsRequest
    from pipeline.training.arms_run import ArmsRun
    from pipeline.training.bundle import read_bundle
    from pipeline.training.option_texts import changed_by_texts
    from pipeline.training.presets import preset
    from pipeline.training.start import check_start

    arms = [Arm(name=f"seed{seed}", seed=seed) for seed in given.seeds or ()]
    arms += [_arm(texts) for texts in given.arm]
    options = preset(given.preset)
    for arm in arms:
        chosen = changed_by_texts(options, dict(_pair(text) for text in (*given.set, *arm.options)))
        check_start(chosen, given.start_from, going=(given.out / arm.name / "checkpoints").is_dir())
    robot = read_bundle(given.bundle).robot
    request = ArmsRequest(
        bundle=given.bundle.resolve(),
        out=given.out.resolve(),
        preset=given.preset,
        start_from=given.start_from and given.start_from.resolve(),
        arms=tuple(arms),
        device=given.device,
        gpus=_gpus(given.device, given.gpus),
        num_envs=given.num_envs,
        iterations=given.iterations,
        minutes=given.minutes,
        options=tuple(given.set),
    )
    request.check()
    if given.detach:
        return _detach(given.out, [text for text in arguments if text != "--detach"])
    run = ArmsRun(
        request, robot, pack=given.pack, first=given.first, workers=given.workers, brief=given.sweep == "brief"
    )
    return run.run()


def _detach(out: Path, arguments: list[str]) -> int:
    out.mkdir(parents=True, exist_ok=True)
    with (out / "log.txt").open("a") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "pipeline.training.train_arms", *arguments],
            stdout=log,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )
    print(f"process {process.pid} runs on; python -m pipeline.training.train_arms wait --out {out}", flush=True)
    return 0


def _wait(out: Path, seconds: float, every: float) -> int:
    """Print the status until the run is over or the time is."""
    began = time.monotonic()
    while True:
        print(status_text(out), flush=True)
        if (out / "done.txt").is_file() or time.monotonic() - began + every > seconds:
            return 0
        time.sleep(every)


def _stop(out: Path) -> int:
    path = out / "process"
    if not path.is_file():
        raise TrainingError(f"{out}: nothing runs there.")
    os.kill(int(path.read_text()), signal.SIGTERM)
    return 0


def status_text(out: Path) -> str:
    """What the run told last. Raises TrainingError where there is none."""
    for name in ("done.txt", "status.txt", "log.txt"):
        if (out / name).is_file():
            return (out / name).read_text().strip()[-4000:]
    raise TrainingError(f"{out}: nothing was started there.")


def _arm(texts: Sequence[str]):
    from pipeline.training.arms import Arm

    if len(texts) < 2 or not texts[1].isdigit():
        raise TrainingError(f"--arm is '{' '.join(texts)}'; it must be NAME SEED [OPTION=VALUE …].")
    return Arm(name=texts[0], seed=int(texts[1]), options=tuple(texts[2:]))


def _pair(text: str) -> tuple[str, str]:
    name, sign, value = text.partition("=")
    if not sign:
        raise TrainingError(f"an option is '{text}'; it must be NAME=VALUE.")
    return name, value


def _gpus(device: str, asked: int | None) -> int:
    """How many GPUs arms are spread over; 0 on a CPU. Raises TrainingError where there are fewer."""
    if device == "cpu":
        return 0
    import torch

    there = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if there < max(1, asked or 1):
        raise TrainingError(f"--device is '{device}' and {asked or 1} GPU is needed, PyTorch finds {there}.")
    return asked or there


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m pipeline.training.train_arms", description="See the module's text."
    )
    parser.add_argument("verb", choices=("run", "wait", "status", "stop"))
    parser.add_argument("--bundle", type=Path, default=Path("data/policies/t1/bundle"))
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--pack", type=Path)
    parser.add_argument("--preset", default=DEFAULT)
    parser.add_argument("--start-from", type=Path, metavar="POLICY")
    parser.add_argument("--seeds", type=int, nargs="+")
    parser.add_argument("--arm", nargs="+", action="append", default=[], metavar="TEXT")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--gpus", type=int)
    parser.add_argument("--num-envs", type=int, default=4096)
    parser.add_argument("--iterations", type=int, default=5000)
    parser.add_argument("--minutes", type=float)
    parser.add_argument("--first", type=int, default=400)
    parser.add_argument("--workers", type=int, default=max(1, (os.cpu_count() or 2) - 6))
    parser.add_argument("--sweep", choices=SWEEPS, default="full")
    parser.add_argument("--detach", action="store_true")
    parser.add_argument("--seconds", type=float, default=1e9)
    parser.add_argument("--every", type=float, default=20.0)
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
