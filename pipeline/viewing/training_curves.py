"""Curves of training runs: rewards, the discriminator's scores, velocity against command, episode length."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from pipeline.viewing.plots import png

COLOURS = ("#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b")
PANELS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("reward a step", ("task_reward", "style_reward")),
    ("discriminator", ("d_expert", "d_policy", "d_rollout")),
    ("episode [s]", ("episode_s",)),
)
"""Title of a panel and the columns of `curves.csv` in it."""
BINS = ("slow", "mid", "fast", "top", "side", "turn")
"""Command bins whose velocity is shown as a share of the command."""
STYLES = ("-", "--", ":")


def training_curves(runs: Mapping[str, pd.DataFrame]) -> bytes:
    """PNG of runs over training time [s]; one colour per run, or per curve for a single run.

    Args:
        runs: name -> a run's `curves.csv`
    """
    figure = Figure(figsize=(11.0, 5.6), dpi=80, layout="constrained")
    places = figure.subplots(2, 2).ravel()
    for place, (title, columns) in zip(places, PANELS, strict=False):
        for number, (name, table) in enumerate(runs.items()):
            for index, column in enumerate(columns):
                colour = COLOURS[number if len(runs) > 1 else index]
                _line(place, table, column, colour, STYLES[index if len(runs) > 1 else 0], f"{name} {column}".strip())
        place.set_title(title, fontsize=9)
    for number, (name, table) in enumerate(runs.items()):
        for index, each in enumerate(BINS):
            if f"{each}_achieved" in table and f"{each}_commanded" in table:
                share = table.assign(share=table[f"{each}_achieved"] / table[f"{each}_commanded"])
                style = STYLES[number % len(STYLES)]
                _line(places[3], share, "share", COLOURS[index], style, f"{name} {each}".strip())
    places[3].set_title("velocity as a share of the command", fontsize=9)
    places[3].set_ylim(-0.2, 1.4)
    for place in places:
        place.set_xlabel("training [s]", fontsize=7)
        place.tick_params(labelsize=6)
        place.grid(alpha=0.3)
        if place.lines:
            place.legend(fontsize=6)
    return png(figure)


def discriminator_curves(arms: Mapping[str, pd.DataFrame], label: str) -> bytes:
    """PNG of the discriminator's mean score on new policy windows over training; one line per run.

    Args:
        arms: name of an arm and seed -> its `curves.csv`
        label: what the arms differ in
    """
    figure = Figure(figsize=(7.0, 4.0), dpi=80, layout="constrained")
    place = figure.subplots()
    names = list(dict.fromkeys(name.split(",")[0] for name in arms))
    for name, table in arms.items():
        _line(place, table, "d_rollout", COLOURS[names.index(name.split(",")[0]) % len(COLOURS)], "-", name)
    place.set(xlabel="training [s]", ylabel="D on the policy's windows")
    place.set_title(label, fontsize=9)
    place.grid(alpha=0.3)
    if place.lines:
        place.legend(fontsize=7)
    return png(figure)


def _line(place, table: pd.DataFrame, column: str, colour: str, style: str, label: str) -> None:
    if column in table and bool(np.isfinite(table[column]).any()):
        place.plot(table["seconds"], table[column], style, color=colour, linewidth=1.1, label=label)
