"""The closed loop: policies that fail a command, their logs, the changed database, and policies trained on it.

    python -m benchmarks.closed_loop --out DIR [--seeds 1 2 3] [--device cpu] [--picture FILE] [--json]

A separate checkout (`DIR/checkout`, with the shipped motions) gets a faulty curation: `most_seconds` of both side steps
is 10 s. All clips of side steps are longer, so the database has none. Then, for each seed:

1. a policy is distilled from the bundle of that database, with the first stage of the recipe;
2. the virtual robot walks with it at the planted command, and its log is written to `data/hardware_logs`.

The logs are ingested, the whole proposal is approved, database and bundle are materialized again, and the same seeds
are distilled from the new bundle. Prints the share of 20 walks of 10 s that fall or achieve less than half of the
command, before and after: at the planted command, its mirror image, and a control command.

Each log of a failing policy raises the limit by a fifth; the clips fit after three. Repeating the command continues an
interrupted run. 32 minutes on 2 cores with `--device cpu`, more where the project's store is empty.
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
from pipeline.files import digest  # noqa: E402
from pipeline.files.atomic import write_text  # noqa: E402
from pipeline.training.plain_walk import Walk, measure_walk  # noqa: E402
from tests.factories.checkout import Checkout  # noqa: E402

LIMIT_S = 10
"""`most_seconds` of a side step in the faulty curation: the clips have one window of 14.5 s each."""
PLANTED, MIRRORED, OTHER = (0.0, 0.4, 0.0), (0.0, -0.4, 0.0), (0.8, 0.0, 0.0)
"""Commands: forward and to the left [m/s], yaw rate [rad/s]."""
WALKS, REACHED = 20, 0.5
"""Number of walks per command, and the achieved share below which a walk counts as failed."""
SMALL = "simulation.num_envs=64"
"""Option of the documented training without a GPU (docs/training.md)."""
WRITE_BUNDLE = "from assets.amp_policy import bundle_of; from pipeline.project import PROJECT; bundle_of(PROJECT, 't1')"
EVIDENCE = ("hardware_trials", "failure_modes", "curation_feedback")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the loop once; exit status 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--device", choices=("cuda", "cpu"), default="cuda")
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    out = given.out.resolve()
    checkout = faulty_checkout(out / "checkout", given.seeds)
    before = bundle(checkout, out / "bundle_before")
    policies = [distilled(before, out / f"before-seed{seed}", seed, given.device) for seed in given.seeds]
    for seed, policy in zip(given.seeds, policies, strict=True):
        simulate(checkout, policy, seed)
    approve(checkout)
    after = bundle(checkout, out / "bundle_after")
    check_difference(before, after, checkout)
    policies += [distilled(after, out / f"after-seed{seed}", seed, given.device) for seed in given.seeds]
    count = len(given.seeds)
    sides = {"before": (before, policies[:count]), "after": (after, policies[count:])}
    if given.picture:
        draw(sides, given.picture)
    found = {name: [figures(side, policy) for policy in trained] for name, (side, trained) in sides.items()}
    return 0 if report(bars_of(found), machine=machine(), json=given.json) else 1


def faulty_checkout(folder: Path, seeds: Sequence[int]) -> Checkout:
    """Create a checkout with the fault, without logs and approvals, and with cached results of this project's store.

    Raises SystemExit if the folder belongs to a run with other seeds, whose logs determine its proposal.
    """
    mark, words = folder / "seeds", " ".join(map(str, seeds))
    if mark.is_file():
        if mark.read_text() != words:
            raise SystemExit(f"{folder}: is of the seeds {mark.read_text()}. Give those, or another --out.")
        return Checkout(folder)
    shutil.rmtree(folder, ignore_errors=True)
    motions = tuple(path.stem for path in (ROOT / "data/motions").iterdir())
    checkout = Checkout.make(ROOT, folder, motions).with_answers_of(ROOT)
    shutil.rmtree(folder / "data/hardware_logs")
    (folder / "data/hardware_logs").mkdir()
    shutil.rmtree(folder / "data/feedback", ignore_errors=True)
    for skill in ("side_left", "side_right"):
        checkout.replace("data/curation.yaml", f"  {skill}: 1200\n", f"  {skill}: {LIMIT_S}\n")
    write_text(mark, words)
    return checkout


def bundle(checkout: Checkout, folder: Path) -> Path:
    """Write the training bundle of the checkout's current database to `folder`, unless it exists."""
    if not folder.is_dir():
        run(checkout, "dagster", "asset", "materialize", "--select", "expert_db")
        run(checkout, sys.executable, "-c", WRITE_BUNDLE)
        part = folder.with_suffix(".part")
        shutil.rmtree(part, ignore_errors=True)
        shutil.copytree(checkout.root / "data/policies/t1/bundle", part)
        part.rename(folder)
    return folder


def distilled(bundle: Path, folder: Path, seed: int, device: str) -> Path:
    """Train a policy with the recipe's first stage."""
    command = [sys.executable, "-m", "pipeline.training", "--bundle", str(bundle), "--out", str(folder)]
    command += ["--seed", str(seed), "--device", device, "--stages", "distillation"]
    command += ["--set", SMALL] if device == "cpu" else []
    status = subprocess.run(command, cwd=ROOT, stdout=sys.stderr).returncode
    if status:
        raise SystemExit(f"training of {folder.name} ended with status {status}; its message is above.")
    return folder / "policy.npz"


def simulate(checkout: Checkout, policy: Path, seed: int) -> None:
    """Write a log of the virtual robot at the planted command to the checkout's log folder, unless it exists."""
    log = checkout.root / f"data/hardware_logs/seed{seed}.mcap"
    if not log.is_file():
        asked = ",".join(f"{value:g}" for value in (0.5, *PLANTED))
        options = ("--policy", str(policy), f"--command={asked}", "--seed", str(seed))
        run(checkout, "booster-lab", "simulate-robot", str(log), *options)


def approve(checkout: Checkout) -> None:
    """Ingest the logs and approve the whole proposal."""
    approved = checkout.root / "data/feedback/approved.yaml"
    if not approved.is_file():
        run(checkout, "dagster", "asset", "materialize", "--select", ",".join(EVIDENCE))
        write_text(approved, (checkout.root / "data/feedback/proposed.yaml").read_text())


def check_difference(before: Path, after: Path, checkout: Checkout) -> None:
    """Raises SystemExit if both bundles have the same references, from which all policies are distilled."""
    if digest.of_file(before / "references.npz") == digest.of_file(after / "references.npz"):
        logs = len(list((checkout.root / "data/hardware_logs").glob("*.mcap")))
        proposal = checkout.root / "data/feedback/approved.yaml"
        raise SystemExit(f"{proposal}: what {logs} logs proposed adds no clip. Three must fail; give other --seeds.")


def figures(bundle: Path, policy: Path) -> dict[str, float]:
    """Share of failed walks at the planted command, its mirror image, and a control command."""
    return {
        f"failed at {x:g}, {y:g} m/s, {turn:g} rad/s": failures(bundle, policy, (x, y, turn))
        for x, y, turn in (PLANTED, MIRRORED, OTHER)
    }


def failures(bundle: Path, policy: Path, command: tuple[float, float, float]) -> float:
    """Share of walks at a single-axis command that fall or achieve less than half of it."""
    shares = [reached(bundle, policy, command, seed) for seed in range(WALKS)]
    return sum(math.isnan(share) or share < REACHED for share in shares) / WALKS


def reached(bundle: Path, policy: Path, command: Sequence[float], seed: int = 0) -> float:
    """Achieved share of a single-axis command; NaN for a fall."""
    axis, (x, y, turn) = int(np.argmax(np.abs(command))), command
    found = measure_walk(bundle, policy, Walk(command=(x, y, turn), seed=seed))
    return math.nan if found["fell"] else found[("forward", "lateral", "yaw_rate")[axis]] / command[axis]


def draw(sides: Mapping[str, tuple[Path, Sequence[Path]]], path: Path) -> None:
    """Draw achieved over commanded lateral velocity: a line per seed, a cross for a fall."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    asked = np.array([each for each in np.linspace(-0.6, 0.6, 13) if abs(each) > 1e-9])
    figure, axes = pyplot.subplots(1, len(sides), figsize=(8.0, 3.6), sharey=True)
    for axis, (name, (bundle, policies)) in zip(axes, sides.items(), strict=True):
        axis.plot(asked, asked, color="0.8", label="commanded")
        for policy in policies:
            velocity = np.array([reached(bundle, policy, (0.0, each, 0.0)) * each for each in asked])
            (line,) = axis.plot(asked, velocity, "o-", label=policy.parent.name.rpartition("-")[2])
            fell = asked[np.isnan(velocity)]
            axis.plot(fell, np.zeros(len(fell)), "x", color=line.get_color())
        axis.axvline(PLANTED[1], color="0.8", linestyle="--")
        axis.set(title=name, xlabel="commanded [m/s] (dashed: in the logs)")
    axes[0].set_ylabel("reached [m/s] (x: fell)")
    axes[0].legend()
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def run(checkout: Checkout, *command: str) -> None:
    """Run a command in the checkout. Raises SystemExit with the end of its output if it fails."""
    print(" ".join(command[:5]), file=sys.stderr, flush=True)
    result = checkout.run(*command, LOKY_MAX_CPU_COUNT=str(os.cpu_count()))
    if result.returncode:
        raise SystemExit(f"{' '.join(command[:5])} failed:\n{result.stdout[-2000:]}{result.stderr[-2000:]}")


if __name__ == "__main__":
    raise SystemExit(main())
