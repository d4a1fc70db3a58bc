"""Arms of the recipe, each trained with several seeds for equal minutes and measured alike.

    python -m benchmarks.ablation --out DIR --arm NAME=BUNDLE[,OPTION=VALUE ...] [--arm ...] [--seeds 1 2 3]
                                  [--minutes M] [--device cuda|cpu] [--robot data/adapted_robot/t1] [--suite full]
                                  [--planted VX VY YAW] [--picture FILE] [--workers N] [--json]

An arm is a bundle (as `amp_policy` writes it: of references, of rollouts, of rollouts with variations) and options of
training. `--minutes` are those of AMP + PPO; distillation has its own (`distillation.minutes`). A run lies in
`DIR/NAME-seedN`; a repeated command continues an interrupted training, and neither trains nor measures again what is
done (`figures.json`). A policy that falls has no figure where it fell. Printed are mean and range over the seeds:

    speed error       mean over the suite's 15 single commands, on the commanded axis [m/s, rad/s]
    commands followed share of the command that is reached, mean over those commands
    style distance    at 0.6, 1.0 and 1.5 m/s (`pipeline.training.style_distance`)
    touchdowns        a minute at 0.6, 0.8 and 1.0 m/s
    power             of the joints at 1.0 m/s [W]
    survival          of pushes of 50 N s, standing and walking
    required cells    of the suite that pass
    accuracy, D       of the discriminator over the second half of the run: largest accuracy, largest difference of D
    failures          at the command `--planted`: share of 20 walks of 10 s that fall or reach less than half of it

The loop from hardware closes where a bundle of the database before and one of the database after an approved proposal
are two arms, and `--planted` is the command that failed: validate with `--failures`, `booster-lab ingest` the logs,
approve the proposal (docs/closed_loop.md), and materialize `amp_policy`, which writes the second bundle.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import math
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline.batch import ClipPool  # noqa: E402
from pipeline.deployment import load_policy  # noqa: E402
from pipeline.learning.training_error import TrainingError  # noqa: E402
from pipeline.training.plain_walk import Walk, walked  # noqa: E402
from pipeline.training.style_distance import SPEEDS, style_distances  # noqa: E402
from pipeline.validation.bars import read_validation  # noqa: E402
from pipeline.validation.deployed import deployed  # noqa: E402
from pipeline.validation.figures import Measured, measure  # noqa: E402
from pipeline.validation.suites import SUITES, cells_of  # noqa: E402
from pipeline.validation.sweep import error_of  # noqa: E402
from pipeline.validation.verdict import judge  # noqa: E402

WALKED = (0.6, 0.8, 1.0)
"""Speeds at which touchdowns are counted [m/s]."""
POWER_AT = 1.0
"""Speed at which power is measured [m/s]."""
PLANTED_WALKS, REACHED = 20, 0.5
"""Walks at a planted command, and the share of it below which a walk counts as a failure."""
PUSHES = ("push force standing 50 Ns", "push force walking 50 Ns")
FIGURES = "figures.json"
STYLE_SEEDS = 3


@dataclass(frozen=True, kw_only=True)
class Arm:
    """One arm: a bundle and options."""

    name: str
    bundle: Path
    options: tuple[str, ...]


def arm_of(text: str) -> Arm:
    """An arm from `NAME=BUNDLE,OPTION=VALUE,...`. Raises ArgumentTypeError for another form."""
    name, _, rest = text.partition("=")
    bundle, *parts = rest.split(",")
    options: list[str] = []
    for part in parts:  # a value may be two numbers: a part without a name belongs to the option before it
        if "=" in part:
            options.append(part)
        elif options:
            options[-1] += f",{part}"
        else:
            raise argparse.ArgumentTypeError(f"'{text}': '{part}' is no OPTION=VALUE")
    if not name or not bundle or "/" in name:
        raise argparse.ArgumentTypeError(f"'{text}' must be NAME=BUNDLE[,OPTION=VALUE ...]")
    return Arm(name=name, bundle=Path(bundle), options=tuple(options))


def main(arguments: Sequence[str] | None = None) -> int:
    """Train and measure all arms; exit status 0, or 1 where a training failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--arm", type=arm_of, action="append", required=True)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--minutes", type=float)
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--robot", type=Path, default=ROOT / "data" / "adapted_robot" / "t1")
    parser.add_argument("--suite", choices=SUITES, default="full")
    parser.add_argument("--planted", type=float, nargs=3, metavar=("VX", "VY", "YAW"))
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--workers", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    found: dict[str, list[dict[str, float]]] = {}
    for arm in given.arm:
        for seed in given.seeds:
            folder = given.out / f"{arm.name}-seed{seed}"
            train(arm, seed, folder, given.minutes, given.device)
            found.setdefault(arm.name, []).append(figures_of(folder, arm.bundle, given))
    if given.picture:
        draw(found, given.picture)
    return 0 if report(bars_of(found), machine=machine(), json=given.json) else 1


def train(arm: Arm, seed: int, folder: Path, minutes: float | None, device: str) -> None:
    """Train a run to its end; nothing where it is done. Raises SystemExit where training fails."""
    limit = [f"schedule.minutes={minutes:g}", "schedule.iterations=100000"] if minutes is not None else []
    options = [*arm.options, *limit]
    command = [sys.executable, "-m", "pipeline.training", "--bundle", str(arm.bundle), "--out", str(folder)]
    command += ["--seed", str(seed), "--device", device]
    command += [text for option in options for text in ("--set", option)]
    status = subprocess.run(command, cwd=ROOT, stdout=sys.stderr).returncode
    if status:
        raise SystemExit(f"training of {folder.name} ended with status {status}; its message is above.")


def figures_of(folder: Path, bundle: Path, given: argparse.Namespace) -> dict[str, float]:
    """Figures of a run, measured once for its policy, robot and suite."""
    policy, path = folder / "policy.npz", folder / FIGURES
    digest = hashlib.sha256(policy.read_bytes()).hexdigest()
    key = {"policy": digest, "suite": given.suite, "robot": str(given.robot), "planted": given.planted}
    known: dict[str, Any] = json.loads(path.read_text()) if path.is_file() else {}
    if known.get("of") == key:
        return {name: math.nan if value is None else value for name, value in known["figures"].items()}
    figures = {
        **cell_figures(policy, given.robot, given.suite, ClipPool(workers=given.workers)),
        **walk_figures(bundle, policy, digest),
        **style_figures(bundle, policy),
        **discriminator_figures(folder / "amp" / "curves.csv"),
        **(planted_figures(bundle, policy, digest, given.planted) if given.planted else {}),
    }
    plain = {name: value if math.isfinite(value) else None for name, value in figures.items()}
    part = path.with_suffix(".part")
    part.write_text(json.dumps({"of": key, "figures": plain}, indent=1) + "\n")
    part.replace(path)
    return figures


def cell_figures(policy: Path, robot: Path, suite: str, pool: ClipPool) -> dict[str, float]:
    """Speed error, commands followed, survival of pushes, and required cells that pass."""
    one = deployed(robot, load_policy(policy))
    rows = measure(one, cells_of(suite, one.robot), pool)
    bars = read_validation(ROOT / "data" / "validation.yaml", ROOT / "robots" / one.robot.name / "validation.yaml")
    verdict = judge(rows, bars, suite=suite, policy="", robot=one.robot.digest)
    required = [cell for cell in verdict.cells if cell.bars.required]
    singles = [row for row in rows if row.cell.group == "commands" and any(goal_of(row))]
    survival = {row.cell.name: row.figure("survival") for row in rows if row.cell.name in PUSHES}
    return {
        "speed error": float(np.mean([error_of(row) for row in singles])),
        "commands followed": float(np.mean([followed(row) for row in singles])),
        "required cells": float(sum(cell.passed for cell in required)),
        **{f"survival of {name}": math.nan if value is None else value for name, value in survival.items()},
    }


def goal_of(row: Measured) -> tuple[float, ...]:
    """The one command of a cell's trials."""
    (goal,) = {trial.command.last.goal for trial in row.cell.trials}
    return goal


def followed(row: Measured) -> float:
    """Share of a single command that is reached, 0 to 1; 0 for a fall."""
    goal = goal_of(row)
    axis = int(np.argmax(np.abs(goal)))
    name = ("forward", "lateral", "yaw_rate")[axis]
    return float(np.mean([np.clip(numbers.get(name, 0.0) / goal[axis], 0.0, 1.0) for numbers in row.trials]))


def walk_figures(bundle: Path, policy: Path, digest: str) -> dict[str, float]:
    """Touchdowns a minute and power, in plain walks."""
    walks = {speed: walked(bundle, policy, digest, Walk(cell="", command=(speed, 0.0, 0.0))) for speed in WALKED}
    found = {f"touchdowns at {speed} m/s": walk.get("steps_per_min", math.nan) for speed, walk in walks.items()}
    return {**found, f"power at {POWER_AT} m/s": walks[POWER_AT].get("power", math.nan)}


def planted_figures(bundle: Path, policy: Path, digest: str, command: Sequence[float]) -> dict[str, float]:
    """Share of walks at a command that fall or reach less than half of it on its largest axis."""
    vx, vy, yaw = command
    axis = int(np.argmax(np.abs(command)))
    name = ("forward", "lateral", "yaw_rate")[axis]
    failed = 0
    for seed in range(PLANTED_WALKS):
        found = walked(bundle, policy, digest, Walk(cell="", command=(vx, vy, yaw), seed=seed))
        failed += bool(found["fell"]) or found[name] / command[axis] < REACHED
    return {f"failures at {vx:g} {vy:g} {yaw:g}": failed / PLANTED_WALKS}


def style_figures(bundle: Path, policy: Path) -> dict[str, float]:
    """Style distances; none where the policy falls."""
    names = {speed: f"style distance at {speed} m/s" for speed in SPEEDS}
    try:
        found = style_distances(bundle, [policy], range(STYLE_SEEDS))[str(policy)]
    except TrainingError as error:
        print(error, file=sys.stderr)
        return dict.fromkeys(names.values(), math.nan)
    return {names[speed]: float(np.mean(values)) for speed, values in found.items()}


def discriminator_figures(curves: Path) -> dict[str, float]:
    """Largest accuracy and difference of D over the second half of a run; none without a discriminator."""
    rows = list(csv.DictReader(curves.read_text().splitlines())) if curves.is_file() else []
    later = rows[len(rows) // 2 :]
    accuracy = [float(row["accuracy"]) for row in later]
    apart = [float(row["d_expert"]) - float(row["d_policy"]) for row in later]
    return {"accuracy": max(accuracy, default=math.nan), "D difference": max(apart, default=math.nan)}


def bars_of(found: Mapping[str, Sequence[Mapping[str, float]]]) -> list[Bar]:
    """Mean, least and largest of each figure over the seeds of each arm."""
    bars = []
    for arm, runs in found.items():
        for name in runs[0]:
            values = [run[name] for run in runs if math.isfinite(run[name])]
            mean = float(np.mean(values)) if values else math.nan
            span = f"{min(values):.3g} to {max(values):.3g}" if values else "fell"
            bars.append(Bar(name=f"{arm}: {name} ({span}, {len(values)} of {len(runs)} seeds)", value=mean))
    return bars


def draw(found: Mapping[str, Sequence[Mapping[str, float]]], path: Path) -> None:
    """One panel a figure, one point a seed."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    names = list(next(iter(found.values()))[0])
    columns = 4
    rows = math.ceil(len(names) / columns)
    figure, axes = pyplot.subplots(rows, columns, figsize=(3.2 * columns, 2.4 * rows), squeeze=False)
    for axis in axes.flat[len(names) :]:
        axis.set_visible(False)
    for axis, name in zip(axes.flat, names, strict=False):
        for at, runs in enumerate(found.values()):
            axis.plot([at] * len(runs), [run[name] for run in runs], "o", alpha=0.7)
        axis.set_title(name, fontsize=8)
        axis.set_xticks(range(len(found)), list(found), fontsize=7)
        axis.margins(x=0.3)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


if __name__ == "__main__":
    raise SystemExit(main())
