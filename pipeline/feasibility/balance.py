"""`MotionWeight`: how often a clip is drawn, so that commands and gaits are covered evenly.

A trainer draws a clip by its weight and then a time within it, so a clip's weight is the weight of a second in
it times its seconds. A second's weight is the product of three parts:

- coverage: the seconds of a cell of the command space share 1 (or a power of it); cells with little get more,
  up to a bound;
- diversity: seconds that are variants of one motion (mirrored, played faster, pieces of it) and lie in the same
  cell count as one motion between them: every parent has an equal part of its cell;
- smoothness: 1 / (1 + (jerk / jerk_0)^2).
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.errors import PipelineError
from pipeline.feasibility.command_cells import cell_of
from pipeline.feasibility.settings import FeasibilitySettings

NEEDED = ("clip", "seconds", "forward_m_s", "lateral_m_s", "yaw_rate_rad_s", "root_jerk")
"""Columns that are looked at; `parent` too where it is there."""


class BalanceError(PipelineError):
    """A table that weights can't be made of."""


def balance(rows: pd.DataFrame, settings: FeasibilitySettings) -> pd.DataFrame:
    """The rows with `weight` (MotionWeight: positive, finite, mean 1 over clips) and `cell`.

    One row a clip. The result doesn't depend on the rows' order, which it keeps. Raises BalanceError where a
    column is missing, a clip is there twice or a number is not finite.
    """
    if rows.empty:
        return rows.assign(weight=pd.Series(dtype=float), cell=pd.Series(dtype=str))
    _check(rows)
    limits = settings.balance
    ordered = rows.sort_values("clip", kind="stable")
    cell = cell_of(ordered, limits.commands)
    parent = parents(ordered)
    seconds = ordered["seconds"].astype(float)
    cell_seconds = seconds.groupby(cell).transform("sum")
    family_seconds = seconds.groupby([cell, parent]).transform("sum")
    families = parent.groupby(cell).transform("nunique")
    coverage = cell_seconds**-limits.cell_power
    diversity = cell_seconds / (families * family_seconds)
    smoothness = 1.0 / (1.0 + (ordered["root_jerk"].astype(float) / limits.smooth_jerk) ** 2)
    second = _bounded(coverage * diversity * smoothness, seconds, limits.max_ratio)
    weight = second * seconds
    weight = weight / weight.mean()
    return rows.assign(weight=weight.reindex(rows.index), cell=cell.reindex(rows.index))


def parents(rows: pd.DataFrame) -> pd.Series:
    """The motion each clip is a variant or a piece of: its `parent`, or its name up to `~` or `+`."""
    from_name = rows["clip"].str.replace(r"[~+].*$", "", regex=True)
    if "parent" not in rows:
        return from_name
    return rows["parent"].where(rows["parent"].notna(), from_name)


def effective_seconds(seconds: pd.Series, weight: pd.Series) -> float:
    """Seconds that count: (sum w)^2 / sum(w^2 / s) for clips of s seconds and weights w (Kish 1965).

    Equal to the sum of the seconds where every second weighs the same.
    """
    total = float((weight**2 / seconds).sum())
    return float(weight.sum()) ** 2 / total if total > 0.0 else 0.0


def _bounded(second: pd.Series, seconds: pd.Series, max_ratio: float) -> pd.Series:
    """Weights of a second, none above `max_ratio` times the mean of all seconds."""
    for _ in range(50):
        mean = float((second * seconds).sum() / seconds.sum())
        if float(second.max()) <= max_ratio * mean * (1.0 + 1e-9):
            break
        second = second.clip(upper=max_ratio * mean)
    return second


def _check(rows: pd.DataFrame) -> None:
    faults = [f"the column '{name}' is missing" for name in NEEDED if name not in rows]
    if not faults:
        faults += [f"clip '{clip}' is there twice" for clip in rows.loc[rows["clip"].duplicated(), "clip"]]
        for name in NEEDED[1:]:
            bad = ~np.isfinite(rows[name].astype(float))
            faults += [f"clip '{clip}': {name} is not finite" for clip in rows.loc[bad, "clip"]]
        faults += [f"clip '{clip}': has no seconds" for clip in rows.loc[rows["seconds"] <= 0.0, "clip"]]
    if faults:
        raise BalanceError(f"no weights can be made: {'; '.join(faults)}")
