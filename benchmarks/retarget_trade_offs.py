"""One picture of the trade-offs between metrics: one weight is varied, all others keep their settings."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from matplotlib.figure import Figure

from benchmarks.retarget_runs import HandedOn, run_ours
from pipeline.retarget import RetargetSettings
from pipeline.robot import Robot
from pipeline.scoring import pooled
from pipeline.viewing.plots import png

FACTORS = (0.4, 0.6, 0.8, 1.0, 1.25, 1.6, 2.5)
"""Factors of the varied weight; 1 is the current setting."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Panel:
    """A weight and the two metrics that it trades against each other."""

    weight: str
    across: tuple[str, str, float]
    """Key of the metric, its label, its bar."""
    up: tuple[tuple[str, str], ...]
    """Keys and labels of the metrics on the other axis."""
    up_label: str
    bar: float


PANELS = (
    Panel(
        weight="posture_second",
        across=("jerk_rad_s3", "jerk [rad/s³]", 220.0),
        up=(("slip_middle_m_s", "slip, middle labels"), ("slip_strict_m_s", "slip, strict labels")),
        up_label="slip [m/s]",
        bar=0.010,
    ),
    Panel(
        weight="legs",
        across=("trunk_error_deg", "trunk error [deg]", 3.5),
        up=(("thigh_error_deg", "thigh"), ("shank_error_deg", "shank")),
        up_label="direction error [deg]",
        bar=4.0,
    ),
    Panel(
        weight="foot_height",
        across=("penetration_max_cm", "deepest penetration [cm]", 1.5),
        up=(("trunk_error_deg", "trunk"),),
        up_label="trunk error [deg]",
        bar=3.5,
    ),
)
"""Panels from left to right."""


def picture(clips: Sequence[HandedOn], settings: RetargetSettings, robot: Robot) -> bytes:
    """Draw a PNG: a panel per weight, a point per factor, current settings ringed, bars as dashed lines."""
    figure = Figure(figsize=(13.0, 4.2), layout="constrained")
    for panel, axes in zip(PANELS, figure.subplots(1, len(PANELS)), strict=True):
        runs = [_figures(clips, _scaled(settings, panel.weight, factor), robot) for factor in FACTORS]
        key, label, bar = panel.across
        for up, name in panel.up:
            x, y = [run[key] for run in runs], [run[up] for run in runs]
            (line,) = axes.plot(x, y, marker="o", markersize=4, label=name)
            chosen = FACTORS.index(1.0)
            axes.plot(x[chosen], y[chosen], "o", markersize=12, fillstyle="none", color=line.get_color())
            for factor, *place in zip(FACTORS, x, y, strict=True):
                axes.annotate(f"×{factor:g}", place, xytext=(4, 4), textcoords="offset points", fontsize=7)
        axes.axvline(bar, linestyle="--", color="0.6", linewidth=1)
        axes.axhline(panel.bar, linestyle="--", color="0.6", linewidth=1)
        axes.set(xlabel=label, ylabel=panel.up_label, title=f"weights.{panel.weight}")
        axes.legend(fontsize=8)
    return png(figure)


def _scaled(settings: RetargetSettings, weight: str, factor: float) -> RetargetSettings:
    weights = dataclasses.replace(settings.weights, **{weight: factor * getattr(settings.weights, weight)})
    return dataclasses.replace(settings, weights=weights)


def _figures(clips: Sequence[HandedOn], settings: RetargetSettings, robot: Robot) -> dict[str, float]:
    return pooled(list(run_ours(clips, settings, robot, repeat=0).scores.values())).figures()
