"""Plots that compare engines: the cross-engine matrix, and limit cycles with those of logs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from pipeline.validation.cross_engine import NAMES, CrossEngineResult
from pipeline.validation.limit_cycle_walks import SIDES, SpeedCycles
from pipeline.validation.limit_cycles import PLANES
from pipeline.viewing.plots import png

ENGINE_COLOURS = {"mujoco": "#1f77b4", "bridge": "#7fb2d9", "dart": "#ff7f0e"}
FIGURES = (
    ("forward_m_s", "forward [m/s]"),
    ("lateral_m_s", "to the left [m/s]"),
    ("yaw_rate_rad_s", "turning left [rad/s]"),
    ("height_m", "height [m]"),
)
PLANE_AXES = (
    ("hip pitch [rad]", "knee [rad]"),
    ("hip pitch [rad]", "its speed · T/2π [rad]"),
    ("knee [rad]", "its speed · T/2π [rad]"),
)
CYCLE_COLOURS = {"MuJoCo": "#1f77b4", "DART": "#ff7f0e"}
LOG_COLOURS = ("#2ca02c", "#d62728", "#9467bd", "#8c564b")


def cross_engine_plots(found: CrossEngineResult) -> bytes:
    """PNG with one row per cell: means of each seed and engine, a cross per fall, grey rows if not required."""
    figure = Figure(figsize=(11.0, 0.28 * len(found.cells) + 1.4), dpi=80, layout="constrained")
    places = figure.subplots(1, len(FIGURES), sharey=True, squeeze=False)[0]
    for place, (name, label) in zip(places, FIGURES, strict=True):
        for row, cell in enumerate(found.cells):
            if not cell.required:
                place.axhspan(row - 0.5, row + 0.5, color="0.93", linewidth=0.0)
            for shift, (engine, each) in enumerate(cell.figures.items()):
                height = row + 0.24 * (shift - (len(cell.figures) - 1) / 2.0)
                values = [getattr(one, name) for one in each if not one.fell]
                place.plot(values, np.full(len(values), height), "|", color=ENGINE_COLOURS[engine], markersize=6)
                fallen = sum(one.fell for one in each)
                if fallen:
                    edge = {"ha": "right", "va": "center", "transform": place.get_yaxis_transform()}
                    place.text(0.99, height, "x" * fallen, color=ENGINE_COLOURS[engine], fontsize=6, **edge)
        place.set_xlabel(label, fontsize=8)
        place.tick_params(labelsize=7)
        place.grid(alpha=0.3)
    places[0].set_yticks(range(len(found.cells)), [cell.name for cell in found.cells], fontsize=7)
    places[0].invert_yaxis()
    engines = found.cells[0].figures if found.cells else ()
    handles = [places[0].plot([], [], "|", color=ENGINE_COLOURS[engine], label=NAMES[engine])[0] for engine in engines]
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles), fontsize=8, frameon=False)
    figure.suptitle(f"{found.robot}: {'passed' if found.passed else 'failed'}", fontsize=9, ha="left", x=0.75)
    return png(figure)


def limit_cycle_plots(found: Sequence[SpeedCycles]) -> bytes:
    """PNG of limit cycles, one row per speed and leg, one column per plane; missing comparisons are in the title."""
    rows = [(each, side) for each in found for side in SIDES]
    figure = Figure(figsize=(9.0, 2.6 * len(rows) + 0.4), dpi=80, layout="constrained")
    grid = figure.subplots(max(len(rows), 1), len(PLANES), squeeze=False)
    for (each, side), places in zip(rows, grid, strict=False):
        mine = {name: cycle for name, cycle in each.cycles.items() if name.endswith(side)}
        spare = iter(LOG_COLOURS * (len(mine) // len(LOG_COLOURS) + 1))
        colours = {name: CYCLE_COLOURS.get(name.split()[0]) or next(spare) for name in mine}
        for plane, place, (x, y) in zip(PLANES, places, PLANE_AXES, strict=True):
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
