"""Plots as PNG bytes, small enough for a run's history, drawn without a display."""

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from pipeline.actuators.calibrate import Calibration
from pipeline.actuators.folder import PublishedCurve

SKILL_COLORS = {
    "stand": "#7f7f7f",
    "turn_left": "#17becf",
    "turn_right": "#1f77b4",
    "side_left": "#98df8a",
    "side_right": "#2ca02c",
    "back": "#9467bd",
    "walk_slow": "#ffbb78",
    "walk": "#ff7f0e",
    "walk_fast_jog": "#e377c2",
    "run": "#d62728",
    "transition": "#c7c7c7",
}
"""A colour for each skill, the same in every plot."""

COMMAND_RANGES = {"forward_m_s": (-0.6, 2.0), "lateral_m_s": (-0.6, 0.6), "yaw_rate_rad_s": (-1.5, 1.5)}
"""The paper's command ranges, Table "Command range of the learned locomotion policy"."""

BOX_WIDTHS = {"forward_m_s": 0.1, "lateral_m_s": 0.1, "yaw_rate_rad_s": 0.25}
"""Widths of the bins of the command space."""

PLANES = (("forward_m_s", "lateral_m_s"), ("forward_m_s", "yaw_rate_rad_s"))

LABELS = {"forward_m_s": "forward [m/s]", "lateral_m_s": "left [m/s]", "yaw_rate_rad_s": "yaw rate [rad/s]"}


def png(figure: Figure) -> bytes:
    """PNG bytes of a figure; the same figure gives the same bytes."""
    stream = io.BytesIO()
    FigureCanvasAgg(figure).print_png(stream, metadata={"Software": None})
    return stream.getvalue()


def labelled(axes: Axes, x: str = "", y: str = "", *, size: int = 8) -> None:
    """Small labels [pt] and a light grid."""
    axes.set_xlabel(x, fontsize=size)
    axes.set_ylabel(y, fontsize=size)
    axes.tick_params(labelsize=size - 1)
    axes.grid(alpha=0.3)


def command_coverage(clips: pd.DataFrame, title: str) -> bytes:
    """Clips (`skill, seconds, forward_m_s, lateral_m_s, yaw_rate_rad_s`) as areas in the paper's command space."""
    figure = Figure(figsize=(9.0, 3.6), dpi=80, layout="constrained")
    for axes, (x, y) in zip(figure.subplots(1, 2), PLANES, strict=True):
        axes.fill_between(COMMAND_RANGES[x], *COMMAND_RANGES[y], color="#eeeeee", zorder=0)
        for skill, color in SKILL_COLORS.items():
            rows = clips[clips["skill"] == skill] if len(clips) else clips
            if len(rows):
                axes.scatter(rows[x], rows[y], s=4.0 * rows["seconds"] + 4.0, color=color, alpha=0.6, label=skill)
        axes.set(xlabel=LABELS[x], ylabel=LABELS[y])
        axes.grid(alpha=0.3)
    figure.suptitle(f"{title}: {clips['seconds'].sum() if len(clips) else 0.0:.0f} s in {len(clips)} clips")
    handles, labels = figure.axes[1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right center", fontsize=7, frameon=False)
    return png(figure)


def command_seconds(boxes: pd.DataFrame, title: str) -> bytes:
    """Boxes of the command space (`forward_m_s, lateral_m_s, yaw_rate_rad_s`) by their `seconds`, as heat maps."""
    figure = Figure(figsize=(9.0, 3.6), dpi=80, layout="constrained")
    weights = boxes["seconds"].to_numpy(dtype=float)
    total = float(np.sum(weights))
    for axes, names in zip(figure.subplots(1, 2), PLANES, strict=True):
        edges = [
            _box_edges(boxes[name].to_numpy(dtype=float), COMMAND_RANGES[name], BOX_WIDTHS[name]) for name in names
        ]
        seconds = np.histogram2d(boxes[names[0]], boxes[names[1]], bins=edges, weights=weights)[0]
        shown = np.ma.masked_less_equal(seconds.T, 0.0)
        image = axes.pcolormesh(*edges, shown, norm=LogNorm(0.02, max(total, 1.0)), cmap="viridis", rasterized=True)
        (x0, x1), (y0, y1) = (COMMAND_RANGES[name] for name in names)
        axes.plot([x0, x1, x1, x0, x0], [y0, y0, y1, y1, y0], color="#d62728", linewidth=1.0)
        axes.set(xlabel=LABELS[names[0]], ylabel=LABELS[names[1]])
    figure.colorbar(image, ax=figure.axes, label="seconds")
    figure.suptitle(f"{title}: {total:.0f} s, by the velocity of each moment")
    return png(figure)


def _box_edges(middles: np.ndarray, shown: tuple[float, float], width: float) -> np.ndarray:
    """Bin edges at multiples of the bin width that cover the default range and the data."""
    low = min(float(middles.min()) if len(middles) else shown[0], shown[0])
    high = max(float(middles.max()) if len(middles) else shown[1], shown[1])
    return width * np.arange(np.floor(low / width), np.ceil(high / width) + 1)


def lost_seconds(judged: pd.DataFrame, title: str) -> bytes:
    """PNG of the 20 clips (`clip, seconds_in, seconds_out`) that lost the most seconds in a stage."""
    table = judged.assign(lost=judged["seconds_in"].fillna(0.0) - judged["seconds_out"].fillna(0.0))
    worst = table.query("lost > 0.0").sort_values(["lost", "clip"], ascending=[False, True]).head(20)[::-1]
    figure = Figure(figsize=(8.0, 0.6 + 0.22 * max(len(worst), 3)), dpi=80, layout="constrained")
    axes = figure.subplots()
    rows = np.arange(len(worst))
    axes.barh(rows, worst["seconds_out"], color="#2ca02c", label="kept")
    axes.barh(rows, worst["lost"], left=worst["seconds_out"], color="#d62728", label="lost")
    axes.set_yticks(rows, list(worst["clip"]), fontsize=7, parse_math=False)  # a name may hold a $
    axes.set(xlabel="seconds", title=title if len(worst) else f"{title}: nothing was lost")
    if len(worst):
        axes.legend(fontsize=7, frameon=False)
    return png(figure)


COLUMNS = 4


def calibration_curves(calibrations: Sequence[Calibration], published: Mapping[str, PublishedCurve]) -> bytes:
    """Each motor's sweep, two lines, knee and its 95 % interval; `published` peak curves by motor are drawn dashed."""
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
    figure.supylabel("torque [N m]", fontsize=8, x=0.003)
    return png(figure)


def _grid(count: int) -> tuple[Figure, list[Any]]:
    rows = max(-(-count // COLUMNS), 1)
    width, height = 10.0, 1.9 * rows + 0.3
    figure = Figure(figsize=(width, height), dpi=80)
    # Fixed margins [inch]: an automatic layout would measure every label of every plot.
    left, right, bottom, top = 0.51 / width, 1.0 - 0.04 / width, 0.44 / height, 1.0 - 0.23 / height
    figure.subplots_adjust(left=left, right=right, bottom=bottom, top=top, wspace=0.15, hspace=0.3)
    axes = list(np.ravel(figure.subplots(rows, COLUMNS, squeeze=False)))
    for place in axes:
        labelled(place, size=7)
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
