"""What a page shows of a training run: its curves, its last figures, velocity against command."""

import json
from pathlib import Path
from typing import Any

import pandas as pd

from assets.report import picture, table_of


def curves_of(folder: Path) -> dict[str, Any]:
    """A run's curves as a picture, and its last figures as numbers that plot over materializations."""
    from pipeline.viewing.training_curves import training_curves

    path = folder / "curves.csv"
    if not path.is_file():
        return {}
    table = pd.read_csv(path)
    last = table.iloc[-1]
    shown = ("task_reward", "style_reward", "d_expert", "d_policy", "episode_s", "steps_per_s")
    numbers = {name: float(last[name]) for name in shown if name in table and last[name] == last[name]}
    bins = [name.removesuffix("_commanded") for name in table if name.endswith("_commanded")]
    speeds = pd.DataFrame(
        [{"command": name, **{kind: last[f"{name}_{kind}"] for kind in ("commanded", "achieved")}} for name in bins]
    )
    achieved = {"achieved against commanded velocity": table_of(speeds, list(speeds))} if bins else {}
    return {**numbers, "curves": picture(training_curves({"": table})), **achieved}


def validation_of(folder: Path) -> dict[str, Any]:
    """What validation found of a run's checkpoints and of the chosen policy; empty for a run that is not validated."""
    found = folder / "validation"
    if not (found / "figures.json").is_file():
        return {}
    sweep, figures = (json.loads((found / name).read_text()) for name in ("sweep.json", "figures.json"))
    swept = pd.DataFrame(sweep["checkpoints"])
    measured = pd.DataFrame([{"figure": name, "value": value} for name, value in figures["figures"].items()])
    return {
        "verdict": figures["summary"],
        "checkpoint": f"iteration {sweep['iteration']}, the best of {len(swept)} in the sweep without noise",
        "sweep of checkpoints": table_of(swept, list(swept)),
        "figures": table_of(measured, list(measured)),
    }
