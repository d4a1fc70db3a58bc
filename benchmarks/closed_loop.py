"""The closed loop: from policies that fail a command to policies of the database that their logs changed.

    python -m benchmarks.closed_loop --out DIR [--seeds 1 2 3] [--device cpu] [--diagonal] [--picture FILE] [--json]

A checkout of its own (`DIR/checkout`, with the shipped motions) gets a curation with a fault: `most_seconds` of both
side steps are 10 s. The clips of them are longer, so the database has none. Then, for each seed:

1. a policy is distilled from the bundle of that database, with the first stage of the recipe;
2. the virtual robot walks at the planted command with it, and its log is put into `data/hardware_logs`.

The logs are ingested, the whole proposal is approved, database and bundle are materialized again, and the same seeds
are distilled from the new bundle. Printed is the share of 20 walks of 10 s that fall or reach less than half of the
command, before and after: at the planted command, at its mirror image, and at one that the loop is not about. With
`--diagonal` the curation stays as it ships, and the planted command is to the side with a turn: no clip shows it.

A repeated command continues where it was interrupted. 32 minutes on 2 cores with `--device cpu`.
"""

from __future__ import annotations

import argparse
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.ablation import bars_of  # noqa: E402
from benchmarks.report import machine, report  # noqa: E402
from pipeline.training.plain_walk import Walk, walked  # noqa: E402
from tests.factories.checkout import Checkout  # noqa: E402

LIMIT_S = 10
"""`most_seconds` of a side step in the faulty curation: the clips have one window of 14.5 s each."""
SIDE, DIAGONAL, OTHER = (0.0, 0.4, 0.0), (0.0, 0.3, 0.4), (0.8, 0.0, 0.0)
"""Commands: forward and to the left [m/s], yaw rate [rad/s]."""
WALKS, REACHED = 20, 0.5
"""Walks at a command, and the share of it below which a walk counts as failed."""
SMALL = ("distillation.minutes=12", "simulation.num_envs=64")
"""Options of the documented training without a GPU (docs/training.md)."""
WRITE_BUNDLE = "from assets.amp_policy import bundle_of; from pipeline.project import PROJECT; bundle_of(PROJECT, 't1')"
EVIDENCE = ("hardware_trials", "failure_modes", "curation_feedback")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the loop once; exit status 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--device", choices=("cuda", "cpu"), default="cuda")
    parser.add_argument("--diagonal", action="store_true")
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    out, command = given.out.resolve(), DIAGONAL if given.diagonal else SIDE
    checkout = made(out / "checkout", faulty=not given.diagonal)
    before = bundle(checkout, out / "bundle_before")
    policies = [distilled(before, out / f"before-seed{seed}", seed, given.device) for seed in given.seeds]
    for seed, policy in zip(given.seeds, policies, strict=True):
        simulate(checkout, policy, command, seed)
    approve(checkout)
    after = bundle(checkout, out / "bundle_after")
    policies += [distilled(after, out / f"after-seed{seed}", seed, given.device) for seed in given.seeds]
    count = len(given.seeds)
    sides = {"before": (before, policies[:count]), "after": (after, policies[count:])}
    if given.picture:
        draw(sides, command, given.picture)
    found = {name: [figures(side, policy, command) for policy in made] for name, (side, made) in sides.items()}
    return 0 if report(bars_of(found), machine=machine(), json=given.json) else 1


def made(folder: Path, *, faulty: bool) -> Checkout:
    """A checkout without logs and approvals; with answers of this project's store, where it has any."""
    if (folder / "made").is_file():
        return Checkout(folder)
    shutil.rmtree(folder, ignore_errors=True)
    motions = tuple(path.stem for path in (ROOT / "data/motions").iterdir())
    checkout = Checkout.make(ROOT, folder, motions).with_answers_of(ROOT)
    shutil.rmtree(folder / "data/hardware_logs")
    (folder / "data/hardware_logs").mkdir()
    shutil.rmtree(folder / "data/feedback", ignore_errors=True)
    for skill in ("side_left", "side_right") if faulty else ():
        checkout.replace("data/curation.yaml", f"  {skill}: 1200\n", f"  {skill}: {LIMIT_S}\n")
    (folder / "made").touch()
    return checkout


def bundle(checkout: Checkout, folder: Path) -> Path:
    """The training bundle of the checkout's database as it is now, copied to `folder` unless it is there."""
    if not folder.is_dir():
        done(checkout, "dagster", "asset", "materialize", "--select", "expert_db")
        done(checkout, sys.executable, "-c", WRITE_BUNDLE)
        part = folder.with_suffix(".part")
        shutil.rmtree(part, ignore_errors=True)
        shutil.copytree(checkout.root / "data/policies/t1/bundle", part)
        part.rename(folder)
    return folder


def distilled(bundle: Path, folder: Path, seed: int, device: str) -> Path:
    """A policy of the recipe's first stage."""
    command = [sys.executable, "-m", "pipeline.training", "--bundle", str(bundle), "--out", str(folder)]
    command += ["--seed", str(seed), "--device", device, "--stages", "distillation"]
    command += [text for option in (SMALL if device == "cpu" else ()) for text in ("--set", option)]
    status = subprocess.run(command, cwd=ROOT, stdout=sys.stderr).returncode
    if status:
        raise SystemExit(f"training of {folder.name} ended with status {status}; its message is above.")
    return folder / "policy.npz"


def simulate(checkout: Checkout, policy: Path, command: Sequence[float], seed: int) -> None:
    """A log of the virtual robot at the planted command, in the checkout's folder of logs unless it is there."""
    log = checkout.root / f"data/hardware_logs/seed{seed}.mcap"
    if not log.is_file():
        asked = ",".join(f"{value:g}" for value in (0.5, *command))
        options = ("--policy", str(policy), f"--command={asked}", "--seed", str(seed))
        done(checkout, "booster-lab", "simulate-robot", str(log), *options)


def approve(checkout: Checkout) -> None:
    """Ingest the logs and approve all that they propose."""
    approved = checkout.root / "data/feedback/approved.yaml"
    if not approved.is_file():
        done(checkout, "dagster", "asset", "materialize", "--select", ",".join(EVIDENCE))
        part = approved.with_suffix(".part")
        shutil.copy(checkout.root / "data/feedback/proposed.yaml", part)
        part.replace(approved)


def figures(bundle: Path, policy: Path, command: Sequence[float]) -> dict[str, float]:
    """Share of failed walks at the planted command, its mirror image, and another."""
    vx, vy, yaw = command
    commands = (vx, vy, yaw), (vx, 0.0 - vy, 0.0 - yaw), OTHER
    return {
        f"failed at {x:g}, {y:g} m/s, {turn:g} rad/s": failures(bundle, policy, (x, y, turn)) for x, y, turn in commands
    }


def failures(bundle: Path, policy: Path, command: tuple[float, float, float]) -> float:
    """Share of walks at a command that fall or reach less than half of it on its largest axis."""
    shares = [reached(bundle, policy, command, seed) for seed in range(WALKS)]
    return sum(math.isnan(share) or share < REACHED for share in shares) / WALKS


def reached(bundle: Path, policy: Path, command: Sequence[float], seed: int = 0) -> float:
    """Share of the largest axis of a command that a walk reaches; NaN if it falls."""
    axis, (x, y, turn) = int(np.argmax(np.abs(command))), command
    found = walked(bundle, policy, Walk(command=(x, y, turn), seed=seed))
    return math.nan if found["fell"] else found[("forward", "lateral", "yaw_rate")[axis]] / command[axis]


def draw(sides: Mapping[str, tuple[Path, Sequence[Path]]], command: Sequence[float], path: Path) -> None:
    """What is reached of the planted command times -1.5 to 1.5: a line a seed, a cross where the robot falls."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    largest = max(command, key=abs)
    unit = "rad/s" if command.index(largest) == 2 else "m/s"
    asked = np.array([factor for factor in np.linspace(-1.5, 1.5, 13) if factor])
    figure, axes = pyplot.subplots(1, len(sides), figsize=(8.0, 3.6), sharey=True)
    for axis, (name, (bundle, policies)) in zip(axes, sides.items(), strict=True):
        axis.plot(asked * largest, asked * largest, color="0.8", label="commanded")
        for policy in policies:
            shares = np.array([reached(bundle, policy, [factor * part for part in command]) for factor in asked])
            (line,) = axis.plot(asked * largest, shares * asked * largest, "o-", label=policy.parent.name[-5:])
            fell = asked[np.isnan(shares)] * largest
            axis.plot(fell, np.zeros(len(fell)), "x", color=line.get_color())
        axis.axvline(largest, color="0.8", linestyle="--")
        axis.set(title=name, xlabel=f"commanded [{unit}] (dashed: in the logs)")
    axes[0].set_ylabel(f"reached [{unit}] (x: fell)")
    axes[0].legend()
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def done(checkout: Checkout, *command: str) -> None:
    """Run a command in the checkout. Raises SystemExit with the end of its output where it fails."""
    print(" ".join(command[:5]), file=sys.stderr, flush=True)
    result = checkout.run(*command, LOKY_MAX_CPU_COUNT=str(os.cpu_count()))
    if result.returncode:
        raise SystemExit(f"{' '.join(command[:5])} failed:\n{result.stdout[-2000:]}{result.stderr[-2000:]}")


if __name__ == "__main__":
    raise SystemExit(main())
