"""Ablation: arms of the recipe, trained with several seeds for equally many iterations and measured equally.

    python -m benchmarks.ablation --out DIR --arm NAME=BUNDLE[,OPTION=VALUE ...] [--arm ...] [--seeds 1 2 3]
                                  [--iterations N] [--device cpu] [--style BUNDLE] [--picture FILE] [--json]

An arm is a bundle (written by `amp_policy`, from references, rollouts, or rollouts with variations) and training
options. `--iterations` sets those of AMP + PPO, unless an arm's options do. A run is in `DIR/NAME-seedN`; repeating the
command continues an interrupted run. `--device cpu` validates runs that were trained elsewhere. Prints mean and range
over the seeds of each run's validation metrics (`pipeline/training/policy_figures.py`). Style is the distance from the
arm's own expert set; to compare arms with different sets, `--style` names one bundle for all.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline.training.policy_figures import from_json, style_figures  # noqa: E402


@dataclass(frozen=True, kw_only=True)
class Arm:
    """One arm: a bundle and training options."""

    name: str
    bundle: Path
    options: tuple[str, ...]


def arm_of(text: str) -> Arm:
    """Parse `NAME=BUNDLE,OPTION=VALUE,...`. Raises ArgumentTypeError for another form."""
    name, _, rest = text.partition("=")
    bundle, *parts = rest.split(",")
    options: list[str] = []
    for part in parts:  # a value may be two numbers: a part without a name belongs to the previous option
        if "=" in part:
            options.append(part)
        elif options:
            options[-1] += f",{part}"
        else:
            raise argparse.ArgumentTypeError(f"'{text}': '{part}' is not OPTION=VALUE")
    if not name or not bundle or "/" in name:
        raise argparse.ArgumentTypeError(f"'{text}' must be NAME=BUNDLE[,OPTION=VALUE ...]")
    return Arm(name=name, bundle=Path(bundle), options=tuple(options))


def main(arguments: Sequence[str] | None = None) -> int:
    """Train and measure all arms; exit status 0, or 1 if a training failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--arm", type=arm_of, action="append", required=True)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--iterations", type=int)
    parser.add_argument("--device", choices=("cuda", "cpu"), default="cuda")
    parser.add_argument("--style", type=Path, metavar="BUNDLE")
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    found: dict[str, list[dict[str, float]]] = {}
    for arm in given.arm:
        for seed in given.seeds:
            folder = given.out / f"{arm.name}-seed{seed}"
            train(arm, seed, folder, given)
            found.setdefault(arm.name, []).append(figures_of(folder, given.style))
    if given.picture:
        draw(found, given.picture)
    return 0 if report(bars_of(found), machine=machine(), json=given.json) else 1


def train(arm: Arm, seed: int, folder: Path, given: argparse.Namespace) -> None:
    """Train a run to its end, unless it is done. Raises SystemExit if training fails."""
    options = [*([f"schedule.iterations={given.iterations}"] if given.iterations is not None else []), *arm.options]
    command = [sys.executable, "-m", "pipeline.training", "--bundle", str(arm.bundle), "--out", str(folder)]
    command += ["--seed", str(seed), "--device", given.device]
    if given.device == "cpu":
        if not (folder / "amp" / "done.json").is_file():
            raise SystemExit(
                f"{folder}: is not trained to its end. Train it on a GPU (--device cuda), or correct --out."
            )
        command += ["--stages", "distillation", "amp", "validation"]
    command += [text for option in options for text in ("--set", option)]
    status = subprocess.run(command, cwd=ROOT, stdout=sys.stderr).returncode
    if status:
        raise SystemExit(f"training of {folder.name} ended with status {status}; its message is above.")


def figures_of(folder: Path, style: Path | None) -> dict[str, float]:
    """Validation metrics of a run and its training time [min]; style relative to the bundle `style`, if given."""
    figures = from_json(json.loads((folder / "validation" / "figures.json").read_text())["figures"])
    figures["minutes of training"] = json.loads((folder / "done.json").read_text())["seconds"] / 60.0
    return figures | (style_figures(style, folder / "policy.npz") if style else {})


def bars_of(found: Mapping[str, Sequence[Mapping[str, float]]]) -> list[Bar]:
    """Mean, minimum and maximum of each metric over the seeds of each arm."""
    bars = []
    for arm, runs in found.items():
        for name in runs[0]:
            values = [run[name] for run in runs if math.isfinite(run[name])]
            mean = float(np.mean(values)) if values else math.nan
            span = f"{min(values):.3g} to {max(values):.3g}" if values else "fell"
            bars.append(Bar(name=f"{arm}: {name} ({span}, {len(values)} of {len(runs)} seeds)", value=mean))
    return bars


def draw(found: Mapping[str, Sequence[Mapping[str, float]]], path: Path) -> None:
    """Draw one panel per metric, one point per seed."""
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
