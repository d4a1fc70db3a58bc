"""Metrics of a trained policy: verdicts of MuJoCo and DART, style distance, touchdowns, and the discriminator.

`required cells` counts the passed required cells of the full suite, `required cells in DART` those of the walks in DART
and across the bridge. Other metrics: speed error, the mean over the suite's 15 single-axis commands [m/s, rad/s];
commands followed, the mean achieved share of these commands; survival of pushes of 50 N s; style distance
(`style_distance.py`); touchdowns per minute; joint power [W]; and the largest accuracy and difference of D of the
discriminator over the second half of the run. A fall counts as the full error and as a command not followed; style,
touchdowns and power are NaN where the policy falls.
"""

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.training.plain_walk import Walk, measure_walk
from pipeline.training.style_distance import style_distances
from pipeline.validation.figures import Measured
from pipeline.validation.sweep import commanded, error_of
from pipeline.validation.verdict import Verdict

TOUCHDOWN_SPEEDS = (0.6, 0.8, 1.0)
"""Commanded speeds at which touchdowns are counted [m/s]."""
POWER_SPEED = 1.0
"""Commanded speed at which power is measured [m/s]."""
PUSHES = ("push force standing 50 Ns", "push force walking 50 Ns")
STYLE_SEEDS = 3


def suite_figures(verdict: Verdict) -> dict[str, float]:
    """Speed error, commands followed, survival of pushes, and passed required cells."""
    rows = [cell.measured for cell in verdict.cells]
    required = [cell for cell in verdict.cells if cell.bars.required]
    singles = [row for row in rows if row.cell.group == "commands" and commanded(row)[0]]
    survival = {row.cell.name: row.figure("survival") for row in rows if row.cell.name in PUSHES}
    return {
        "required cells": float(sum(cell.passed for cell in required)),
        "speed error": _mean([error_of(row) for row in singles]),
        "commands followed": _mean([followed(row) for row in singles]),
        **{f"survival of {name}": math.nan if value is None else value for name, value in survival.items()},
    }


def followed(row: Measured) -> float:
    """Achieved share of a single-axis command, 0 to 1; 0 for a fall."""
    goal, reached = commanded(row)
    return _mean([np.clip(value / goal, 0.0, 1.0) for value in reached])


def walk_figures(bundle: Path, policy: Path) -> dict[str, float]:
    """Touchdowns per minute and power, in plain MuJoCo."""
    walks = {speed: measure_walk(bundle, policy, Walk(command=(speed, 0.0, 0.0))) for speed in TOUCHDOWN_SPEEDS}
    figures = {f"touchdowns at {speed} m/s": walk.get("touchdowns_per_min", math.nan) for speed, walk in walks.items()}
    return {**figures, f"power at {POWER_SPEED} m/s": walks[POWER_SPEED].get("power", math.nan)}


def style_figures(bundle: Path, policy: Path) -> dict[str, float]:
    """Style distances; NaN at speeds where the policy falls or the database has no walk."""
    distances = style_distances(bundle, [policy], range(STYLE_SEEDS))[str(policy)]
    return {f"style distance at {speed} m/s": _mean(values) for speed, values in distances.items()}


def discriminator_figures(curves: Path) -> dict[str, float]:
    """Largest accuracy and difference of D over the second half of a run; NaN without a discriminator."""
    rows = list(csv.DictReader(curves.read_text().splitlines())) if curves.is_file() else []
    second_half = [row for row in rows[len(rows) // 2 :] if "accuracy" in row]
    accuracy = [float(row["accuracy"]) for row in second_half]
    difference = [float(row["d_expert"]) - float(row["d_policy"]) for row in second_half]
    return {"accuracy": max(accuracy, default=math.nan), "D difference": max(difference, default=math.nan)}


def as_json(figures: dict[str, float]) -> dict[str, Any]:
    """Replace values that are not finite with None."""
    return {name: value if math.isfinite(value) else None for name, value in figures.items()}


def from_json(figures: dict[str, Any]) -> dict[str, float]:
    """Inverse of `as_json`."""
    return {name: math.nan if value is None else float(value) for name, value in figures.items()}


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else math.nan
