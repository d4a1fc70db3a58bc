"""`MotionWeight`: the sampling weight of a clip, for an even coverage of commands and gaits.

A trainer samples a clip by its weight and then a time within it, so a clip's weight is the weight per second times its
seconds. The weight per second of a clip is the mean over the cells of the command space that it visits, weighted by the
seconds in each. In a cell it is the product of three factors:

- coverage: each cell has the same total weight (adjustable by a power), shared by its seconds, so that seconds of cells
  with little data weigh more, up to a bound;
- diversity: each family has an equal part of its cell's weight. A family consists of the variants of one motion
  (mirrored, time-scaled, pieces of it) and of all motions with the same mean joint motion (`gait_signature`): copies,
  repetitions, long recordings of one gait;
- smoothness: 1 / (1 + (jerk / jerk_0)^2).

A cell, or a family in it, with less than `missing_seconds` has a proportionally smaller part, so that merely passing
through a cell does not count as covering it.
"""

import re
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from pipeline.errors import PipelineError
from pipeline.feasibility.command_space import SECONDS_COLUMN, CommandSettings, by_command, cell_of
from pipeline.feasibility.criterion import MetresPerSecondCubed
from pipeline.feasibility.gait_signature import COLUMN as SIGNATURE
from pipeline.feasibility.gait_signature import families
from pipeline.files.ranges import POSITIVE, SHARE, Range
from pipeline.files.sourced import Unit

NEEDED = ("clip", "seconds", "forward_m_s", "lateral_m_s", "yaw_rate_rad_s", "root_jerk")
"""Required columns."""

READ = (*NEEDED, "parent", SECONDS_COLUMN, SIGNATURE)
"""Required and optional columns."""

WITHIN_A_TAKE = r"@\d+-\d+|\+\d+"
"""Suffixes of a clip's name that distinguish windows and pieces of one take."""

MADE = ("weight", "cell", "family")
"""Columns that are added."""


@dataclass(frozen=True, kw_only=True)
class BalanceSettings:
    """Distribution of the weight over feasible clips."""

    cell_power: Annotated[float, SHARE, Unit("-")]
    """0: every second weighs the same; 1: every cell weighs the same."""
    max_ratio: Annotated[float, Range(1.0), Unit("of the mean second")]
    """Largest weight of a second over the mean weight of a second."""
    same_gait: Annotated[float, Range(0.0, 1.0), Unit("rad")]
    """Motions whose gait signatures differ by less than this [rad, root mean square] are one family."""
    smooth_jerk: MetresPerSecondCubed
    """Mean jerk [m/s^3] at which a clip's weight is halved."""
    missing_seconds: Annotated[float, POSITIVE, Unit("s")]
    """Seconds below which a cell counts as missing [s]."""


class BalanceError(PipelineError):
    """Raised for a table from which weights cannot be computed."""


def balance(rows: pd.DataFrame, settings: BalanceSettings, commands: CommandSettings) -> pd.DataFrame:
    """Add `weight` (MotionWeight: positive, finite, mean 1 over clips), `cell` (with the most seconds of the clip) and
    `family` (name of the first motion in it) to a table with one row per clip.

    The order of the rows is kept and does not affect the weights. Raises BalanceError if a column is missing, a clip
    occurs twice or a number is not finite.
    """
    if rows.empty:
        return rows.assign(weight=pd.Series(dtype=float), cell=pd.Series(dtype=str), family=pd.Series(dtype=str))
    _check(rows)
    ordered = rows.sort_values("clip", kind="stable").reset_index(names="place")
    ordered = ordered.assign(family=families(ordered, parents(ordered), settings.same_gait))
    spent = by_command(ordered.drop(columns=[SIGNATURE, "parent"], errors="ignore"))
    spent = spent.assign(cell=cell_of(spent, commands))
    worth = _second_weight(spent, settings) * spent["seconds"].to_numpy(dtype=float)
    seconds = ordered["seconds"].to_numpy(dtype=float)
    mean_second = np.bincount(spent["row"], weights=worth, minlength=len(ordered)) / seconds
    smoothness = 1.0 / (1.0 + (ordered["root_jerk"].to_numpy(dtype=float) / settings.smooth_jerk) ** 2)
    second = _bounded(mean_second * smoothness, seconds, settings.max_ratio)
    weight = pd.Series(second * seconds / np.mean(second * seconds), index=ordered["place"])
    longest = spent.groupby(["row", "cell"])["seconds"].sum().groupby("row").idxmax()
    cell = pd.Series([name for _, name in longest], index=ordered["place"])
    family = pd.Series(ordered["family"].to_numpy(), index=ordered["place"])
    return rows.assign(
        **{name: made.reindex(rows.index) for name, made in zip(MADE, (weight, cell, family), strict=True)}
    )


def _second_weight(spent: pd.DataFrame, limits: BalanceSettings) -> np.ndarray:
    """Coverage times diversity per second (n,) for each row of a table by command with `cell` and `family`."""
    least, cell = limits.missing_seconds, spent["cell"].to_numpy()
    family_seconds = spent.groupby(["cell", "family"])["seconds"].transform("sum").to_numpy(dtype=float)
    cell_seconds = spent.groupby("cell")["seconds"].transform("sum").to_numpy(dtype=float)
    presence = np.minimum(family_seconds, least)
    share = presence * spent["seconds"].to_numpy(dtype=float) / family_seconds  # sums to the presence of the family
    cell_presence = pd.Series(share).groupby(cell).transform("sum").to_numpy(dtype=float)
    cell_weight = cell_seconds ** (1.0 - limits.cell_power) * np.minimum(cell_seconds / least, 1.0)
    return cell_weight * presence / cell_presence / family_seconds


def parents(rows: pd.DataFrame) -> pd.Series:
    """Name of the motion that each clip is a variant or piece of: its `parent`, or its name up to `~` or `+`."""
    parent_of = rows["parent"] if "parent" in rows else pd.Series(index=rows.index, dtype=object)
    names = [
        re.split(r"[~+]", clip, maxsplit=1)[0] if pd.isna(parent) else parent
        for clip, parent in zip(rows["clip"], parent_of, strict=True)
    ]
    return pd.Series(names, index=rows.index)


def takes(rows: pd.DataFrame) -> Int[np.ndarray, " n"]:
    """Integer id of each row's take; windows and pieces of one take have the same id."""
    return pd.factorize(rows["clip"].astype(object).str.replace(WITHIN_A_TAKE, "", regex=True))[0]


def effective_seconds_of(
    family: Int[np.ndarray, " n"],
    take: Int[np.ndarray, " n"],
    seconds: Float[np.ndarray, " n"],
    weight: Float[np.ndarray, " n"],
) -> float:
    """Effective seconds of distinct motion in weighted clips.

    (sum W)^2 / sum(W^2 / S) (effective sample size, Kish 1965) over families with weight W and S distinct seconds,
    which are those of the family's longest take. Equal to the sum of S if all distinct seconds have the same weight;
    copies add nothing, and a family with too much weight for its seconds reduces the result.

    Args:
        family: integer id of each clip's family
        take: integer id of each clip's take: a recording or one variant of it (`takes`)
        seconds: duration of each clip [s]
        weight: weight of each clip
    """
    order = np.lexsort((take, family))
    family, take, seconds, weight = family[order], take[order], seconds[order], weight[order]
    new_family = np.diff(family, prepend=-1) != 0
    new_take = np.flatnonzero(new_family | (np.diff(take, prepend=-1) != 0))
    families = np.flatnonzero(new_family)
    if not len(families):
        return 0.0
    own = np.maximum.reduceat(np.add.reduceat(seconds, new_take), np.searchsorted(new_take, families))
    total = float(np.sum(np.square(np.add.reduceat(weight, families)) / own))
    return float(np.sum(weight)) ** 2 / total if total > 0.0 else 0.0


def _bounded(second: np.ndarray, seconds: np.ndarray, max_ratio: float) -> np.ndarray:
    """Limit the weights per second (n,) to `max_ratio` times the mean over all seconds."""
    for _ in range(50):
        mean = np.sum(second * seconds) / np.sum(seconds)
        if np.max(second) <= max_ratio * mean * (1.0 + 1e-9):
            break
        second = np.minimum(second, max_ratio * mean)
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
