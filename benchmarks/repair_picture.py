"""Plot of detection rate over defect strength."""

from __future__ import annotations

from pathlib import Path

import matplotlib

from benchmarks.repair_floors import COUNTED
from benchmarks.repair_judge import Verdict

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot

EDGES = np.array([0.1, 0.3, 0.45, 0.7, 1.0, 1.5, 2.2, 3.3, 5.0, 10.0])
"""Edges of the strength bins; 1 is the smallest strength that counts."""
FEWEST = 5
"""Least number of defects in a drawn bin."""
SHOWN = (
    "joint_dropout",
    "limb_dropout",
    "spike",
    "noise",
    "sign_flip",
    "frozen",
    "root_teleport",
    "heading_jump",
    "foot_skate",
    "floor_offset",
    "floor_drift",
)
"""Kinds whose strength varies about 1."""


def draw(verdicts: dict[str, list[Verdict]], path: Path) -> None:
    """Draw the detection rate of each kind over its strength."""
    figure, axes = pyplot.subplots(figsize=(8.0, 4.5), dpi=110)
    markers = "os^vD<>pP*X"
    for marker, kind in zip(markers, [kind for kind in SHOWN if kind in verdicts], strict=False):
        drawn = [one for one in verdicts[kind] if one.group in ("", *COUNTED)]
        strength = np.array([one.strength for one in drawn])
        found = np.array([one.detected for one in drawn], dtype=float)
        which = np.digitize(strength, EDGES)
        bins = [index for index in range(1, len(EDGES)) if (which == index).sum() >= FEWEST]
        middle = [float(np.sqrt(EDGES[index - 1] * EDGES[index])) for index in bins]
        share = [100.0 * found[which == index].mean() for index in bins]
        axes.plot(middle, share, marker=marker, markersize=4, linewidth=1.2, label=kind.replace("_", " "))
    axes.axvline(1.0, color="0.6", linewidth=1.0, linestyle="--")
    axes.set_xscale("log")
    axes.set_xticks([0.2, 0.5, 1, 2, 5], ["0.2", "0.5", "1", "2", "5"])
    axes.minorticks_off()
    axes.set_xlabel("strength of the defect (1: the least that matters)")
    axes.set_ylabel("found [%]")
    axes.set_ylim(-3, 103)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7, ncols=2, loc="lower right")
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={"Software": None})
    pyplot.close(figure)
