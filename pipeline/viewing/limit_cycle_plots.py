"""Plots of limit cycles: one row per speed and leg, one column per plane; engines and logs overlaid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from pipeline.validation.limit_cycle_walks import SIDES, SpeedCycles
from pipeline.validation.limit_cycles import PLANES
from pipeline.viewing.plots import png

AXES = (
    ("hip pitch [rad]", "knee [rad]"),
    ("hip pitch [rad]", "its speed · T/2π [rad]"),
    ("knee [rad]", "its speed · T/2π [rad]"),
)
COLOURS = {"MuJoCo": "#1f77b4", "DART": "#ff7f0e"}
OF_LOGS = ("#2ca02c", "#d62728", "#9467bd", "#8c564b")


def limit_cycle_plots(found: Sequence[SpeedCycles]) -> bytes:
    """PNG of the cycles of all speeds; missing comparisons are in the title."""
    rows = [(each, side) for each in found for side in SIDES]
    figure = Figure(figsize=(9.0, 2.6 * len(rows) + 0.4), dpi=80, layout="constrained")
    grid = figure.subplots(max(len(rows), 1), len(PLANES), squeeze=False)
    for (each, side), places in zip(rows, grid, strict=False):
        mine = {name: cycle for name, cycle in each.cycles.items() if name.endswith(side)}
        spare = iter(OF_LOGS * (len(mine) // len(OF_LOGS) + 1))
        colours = {name: COLOURS.get(name.split()[0]) or next(spare) for name in mine}
        for plane, place, (x, y) in zip(PLANES, places, AXES, strict=True):
            for name, cycle in mine.items():
                curve = cycle.plane(plane)
                closed = np.concatenate([curve, curve[:1]])
                place.plot(closed[:, 0], closed[:, 1], color=colours[name], linewidth=1.3, label=name)
            place.set_xlabel(x, fontsize=7)
            place.set_ylabel(y, fontsize=7)
            place.tick_params(labelsize=6)
            place.grid(alpha=0.3)
        places[0].set_title(f"{each.speed_m_s:g} m/s, {side} leg", fontsize=8, loc="left")
        if mine:
            places[-1].legend(fontsize=6)
        else:
            places[1].set_title("nothing to show", fontsize=8, color="#d62728")
    return png(figure)
