"""Environment steps per second of training, including network updates.

    python -m benchmarks.train --bundle DIR [--device cuda|cpu] [--num-envs N] [--presets ...] [--iterations N] [--json]
                               [--stages amp distillation] [--physics plain warp]

`amp_policy` writes the bundle (`data/policies/<robot>/bundle`). Each preset and stage trains in a separate process; the
median excludes the first iterations, in which kernels load and buffers fill. On a CPU use 64 environments with `plain`
physics (MuJoCo in threads), 8 with `warp`; `--physics plain warp` compares both.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402

WARM_UP = 5
"""Warm-up iterations, excluded from the median."""
BARS = {("recipe", "amp"): 150_000.0, ("paper", "amp"): 60_000.0}
"""Least speed on one H100 or H200 with 4096 environments [steps/s]."""
ITERATIONS = {"amp": "schedule.iterations", "distillation": "distillation.iterations"}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bundle", type=Path, default=ROOT / "data" / "policies" / "t1" / "bundle")
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--num-envs", type=int, default=4096)
    parser.add_argument("--presets", nargs="+", default=["recipe", "paper"])
    parser.add_argument("--stages", nargs="+", choices=tuple(ITERATIONS), default=["amp"])
    parser.add_argument("--physics", nargs="+", choices=("plain", "warp"), help="default: the device's own")
    parser.add_argument("--iterations", type=int, default=40)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    bars = []
    for name, stage, physics in itertools.product(given.presets, given.stages, given.physics or [None]):
        if (name, stage) == ("paper", "distillation"):
            continue
        speed = median_speed(given, name, stage, physics)
        bar = BARS.get((name, stage)) if given.device != "cpu" else None
        where = f"{given.num_envs} environments, {given.device}{f', {physics}' if physics else ''}"
        label = f"{name}, {stage}, {where}"
        bars.append(Bar(name=label, value=speed, unit="steps/s", sense=">=" if bar else "", bound=bar))
    return 0 if report(bars, machine=machine(), json=given.json) else 1


def median_speed(given: argparse.Namespace, preset: str, stage: str, physics: str | None) -> float:
    """Median speed of a short run after the warm-up [steps/s]."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pipeline.training", *run_arguments(given, preset, stage, physics, folder)]
        status = subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL).returncode
        if status:
            raise SystemExit(f"the run of {preset} ended with status {status}; its message is above.")
        rows = list(csv.DictReader((Path(folder) / "curves.csv").read_text().splitlines()))
    counted = rows[WARM_UP:] or rows
    return float(np.median([float(row["steps_per_s"]) for row in counted]))


def run_arguments(given: argparse.Namespace, preset: str, stage: str, physics: str | None, out: str) -> list[str]:
    """Arguments of `pipeline.training` for a run of one stage; AMP + PPO starts from scratch.

    Args:
        given: arguments of this benchmark
        preset: preset of the options
        stage: training stage
        physics: `plain` or `warp`; None: the device's default
        out: folder of the run
    """
    options = [f"simulation.num_envs={given.num_envs}"]
    options += ["distillation.iterations=0"] if stage == "amp" else []
    options += [f"{ITERATIONS[stage]}={given.iterations}"]
    arguments = ["--bundle", str(given.bundle), "--out", out, "--preset", preset, "--device", given.device]
    arguments += ["--stages", stage, *(text for option in options for text in ("--set", option))]
    return arguments + (["--physics", physics] if physics else [])


if __name__ == "__main__":
    raise SystemExit(main())
