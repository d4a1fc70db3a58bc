"""Plot of the cross-engine matrix: one row per cell, velocities in each engine, and falls."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from pipeline.validation.cross_engine import NAMES, CrossEngineResult
from pipeline.viewing.plots import png

COLOURS = {"mujoco": "#1f77b4", "bridge": "#7fb2d9", "dart": "#ff7f0e"}
FIGURES = (
    ("forward_m_s", "forward [m/s]"),
    ("lateral_m_s", "to the left [m/s]"),
    ("yaw_rate_rad_s", "turning left [rad/s]"),
    ("height_m", "height [m]"),
)


def cross_engine_plots(found: CrossEngineResult) -> bytes:
    """PNG: means of each seed, a cross at the edge for each fall; rows that are not required are grey."""
    figure = Figure(figsize=(11.0, 0.28 * len(found.cells) + 1.4), dpi=80, layout="constrained")
    places = figure.subplots(1, len(FIGURES), sharey=True, squeeze=False)[0]
    for place, (name, label) in zip(places, FIGURES, strict=True):
        for row, cell in enumerate(found.cells):
            if not cell.required:
                place.axhspan(row - 0.5, row + 0.5, color="0.93", linewidth=0.0)
            for shift, (engine, each) in enumerate(cell.figures.items()):
                height = row + 0.24 * (shift - (len(cell.figures) - 1) / 2.0)
                values = [getattr(one, name) for one in each if not one.fell]
                place.plot(values, np.full(len(values), height), "|", color=COLOURS[engine], markersize=6)
                fallen = sum(one.fell for one in each)
                if fallen:
                    place.text(0.99, height, "x" * fallen, color=COLOURS[engine], fontsize=6, ha="right", va="center",
                               transform=place.get_yaxis_transform())  # fmt: skip
        place.set_xlabel(label, fontsize=8)
        place.tick_params(labelsize=7)
        place.grid(alpha=0.3)
    places[0].set_yticks(range(len(found.cells)), [cell.name for cell in found.cells], fontsize=7)
    places[0].invert_yaxis()
    engines = found.cells[0].figures if found.cells else ()
    handles = [places[0].plot([], [], "|", color=COLOURS[engine], label=NAMES[engine])[0] for engine in engines]
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles), fontsize=8, frameon=False)
    figure.suptitle(f"{found.robot}: {'passed' if found.passed else 'failed'}", fontsize=9, ha="left", x=0.75)
    return png(figure)
