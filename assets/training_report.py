"""What a page shows of a training run: its curves, its last figures, velocity against command."""

from pathlib import Path
from typing import Any

import pandas as pd

from assets.report import picture, table_of


def curves_of(folder: Path) -> dict[str, Any]:
    """A run's curves as a picture, and its last figures as numbers that plot over materializations."""
    from pipeline.viewing.tracking_plots import training_curves

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
