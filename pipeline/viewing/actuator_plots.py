"""Plots of torque-speed curves: points, fit, knee and interval of each motor; ranges reached in a log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from pipeline.actuators import Calibration
from pipeline.actuators.folder import PublishedCurve
from pipeline.viewing.plots import png

COLUMNS = 4


def calibration_curves(calibrations: Sequence[Calibration], published: Mapping[str, PublishedCurve]) -> bytes:
    """Each motor's sweep with its two lines and its knee; the box about it is the 95 % interval.

    Args:
        published: by motor name, the manufacturer's peak curve, drawn dashed
    """
    figure, axes = _grid(len(calibrations))
    for each, place in zip(calibrations, axes, strict=False):
        speed, torque = np.array(each.speed), np.array(each.torque)
        outlier, forward = np.array(each.outlier, dtype=bool), np.array(each.forward, dtype=bool)
        for chosen, marker, colour in ((forward, ">", "#1f77b4"), (~forward, "<", "#17becf")):
            good = chosen & ~outlier
            place.plot(speed[good], torque[good], marker, color=colour, markersize=2.5)
        place.plot(speed[outlier], torque[outlier], "x", color="#7f7f7f", markersize=4)
        if each.motor in published:
            place.plot(*zip(*published[each.motor].corners, strict=True), "--", color="#bbbbbb", linewidth=1.0)
        _knee(place, each)
        good = "#000000" if each.accepted else "#d62728"
        place.set_title(f"{each.motor}{'' if each.accepted else ': refused'}", fontsize=8, color=good)
        place.set_ylim(bottom=0.0, top=1.6 * float(torque.max()) if len(torque) else 1.0)
    figure.supxlabel("joint speed [rad/s]", fontsize=8)
    figure.supylabel("torque [N m]", fontsize=8)
    return png(figure)


def _grid(count: int) -> tuple[Figure, list[Any]]:
    rows = max(-(-count // COLUMNS), 1)
    figure = Figure(figsize=(10.0, 1.9 * rows + 0.3), dpi=80, layout="constrained")
    axes = list(np.ravel(figure.subplots(rows, COLUMNS, squeeze=False)))
    for place in axes:
        place.tick_params(labelsize=6)
        place.grid(alpha=0.3)
    for place in axes[count:]:
        place.set_axis_off()
    return figure, axes


def _knee(place: Any, calibration: Calibration) -> None:
    knee = calibration.knee
    if knee is None:
        return
    colour = "#d62728" if calibration.accepted else "#7f7f7f"
    corners = ((0.0, knee.stall_torque), (knee.speed.value, knee.torque.value), (knee.no_load_speed, 0.0))
    place.plot(*zip(*corners, strict=True), color="#ff7f0e", linewidth=1.2)
    width, height = knee.speed.high - knee.speed.low, knee.torque.high - knee.torque.low
    place.add_patch(Rectangle((knee.speed.low, knee.torque.low), width, height, fill=False, edgecolor=colour))
    place.plot([knee.speed.value], [knee.torque.value], "o", color=colour, markersize=4, fillstyle="none")
    text = "\n".join(
        f"{each.value:.2f} {unit} ({each.low:.2f} to {each.high:.2f})"
        for each, unit in ((knee.torque, "N m"), (knee.speed, "rad/s"))
    )
    place.annotate(text, (0.03, 0.05), xycoords="axes fraction", fontsize=6, color=colour)
