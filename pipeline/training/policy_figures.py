"""Figures of a trained policy: verdicts of MuJoCo and DART, style distance, touchdowns, and the discriminator.

`required cells` are those of the full suite that pass, `required cells in DART` those of the walks in DART and across
the bridge. Other figures: speed error, the mean over the suite's 15 single commands on the commanded axis [m/s, rad/s];
commands followed, the share of the command that is reached, mean over those; survival of pushes of 50 N s; style
distance (`style_distance.py`); touchdowns a minute; power of the joints [W]; and of the discriminator, over the second
half of the run, the largest accuracy and the largest difference of D. A fall counts as the whole error and as a command
not followed; style, touchdowns and power have no figure (NaN) where the policy falls.
"""

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.training.plain_walk import Walk, walked
from pipeline.training.style_distance import style_distances
from pipeline.validation.figures import Measured
from pipeline.validation.sweep import commanded, error_of
from pipeline.validation.verdict import Verdict

WALKED = (0.6, 0.8, 1.0)
"""Speeds at which touchdowns are counted [m/s]."""
POWER_AT = 1.0
"""Speed at which power is measured [m/s]."""
PUSHES = ("push force standing 50 Ns", "push force walking 50 Ns")
STYLE_SEEDS = 3


def suite_figures(verdict: Verdict) -> dict[str, float]:
    """Speed error, commands followed, survival of pushes, and required cells that pass."""
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
    """Share of a single command that is reached, 0 to 1; 0 for a fall."""
    goal, reached = commanded(row)
    return _mean([np.clip(value / goal, 0.0, 1.0) for value in reached])


def walk_figures(bundle: Path, policy: Path) -> dict[str, float]:
    """Touchdowns a minute and power, in plain walks."""
    walks = {speed: walked(bundle, policy, Walk(command=(speed, 0.0, 0.0))) for speed in WALKED}
    found = {f"touchdowns at {speed} m/s": walk.get("touchdowns_per_min", math.nan) for speed, walk in walks.items()}
    return {**found, f"power at {POWER_AT} m/s": walks[POWER_AT].get("power", math.nan)}


def style_figures(bundle: Path, policy: Path) -> dict[str, float]:
    """Style distances; NaN at speeds at which the policy falls or the database has no walk."""
    found = style_distances(bundle, [policy], range(STYLE_SEEDS))[str(policy)]
    return {f"style distance at {speed} m/s": _mean(values) for speed, values in found.items()}


def discriminator_figures(curves: Path) -> dict[str, float]:
    """Largest accuracy and difference of D over the second half of a run; none without a discriminator."""
    rows = list(csv.DictReader(curves.read_text().splitlines())) if curves.is_file() else []
    later = [row for row in rows[len(rows) // 2 :] if "accuracy" in row]
    accuracy = [float(row["accuracy"]) for row in later]
    apart = [float(row["d_expert"]) - float(row["d_policy"]) for row in later]
    return {"accuracy": max(accuracy, default=math.nan), "D difference": max(apart, default=math.nan)}


def as_json(figures: dict[str, float]) -> dict[str, Any]:
    """The figures with None in place of what is not finite."""
    return {name: value if math.isfinite(value) else None for name, value in figures.items()}


def from_json(figures: dict[str, Any]) -> dict[str, float]:
    """Inverse of `as_json`."""
    return {name: math.nan if value is None else float(value) for name, value in figures.items()}


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else math.nan
