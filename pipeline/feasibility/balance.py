"""`MotionWeight`: how often a clip is drawn, so that commands and gaits are covered evenly.

A trainer draws a clip by its weight and then a time within it, so a clip's weight is the weight of a second in
it times its seconds. A clip's second weighs the mean of what its seconds do, cell by cell of the command space that
the robot is in during them. There it is the product of three parts:

- coverage: the seconds of a cell share 1 (or a power of it); cells with little get more, up to a bound;
- diversity: seconds of one family that lie in the same cell count as one motion between them, and every family has
  an equal part of its cell. A family are the variants of one motion (mirrored, played faster, pieces of it) and all
  motions whose joints do the same on average (`gait_signature`): copies, repeats, a gait recorded at length;
- smoothness: 1 / (1 + (jerk / jerk_0)^2).

A cell or a motion in it with less than `missing_seconds` has its part in proportion, so that passing through for a
moment is no presence.
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
"""Columns that are read ..."""

READ = (*NEEDED, "parent", SECONDS_COLUMN, SIGNATURE)
"""... and those that are read where they are there."""

WITHIN_A_TAKE = r"@\d+-\d+|\+\d+"
"""Parts of a clip's name that tell windows and pieces of one take apart."""

MADE = ("weight", "cell", "family")
"""Columns that are added."""


@dataclass(frozen=True, kw_only=True)
class BalanceSettings:
    """How feasible clips share the weight."""

    cell_power: Annotated[float, SHARE, Unit("-")]
    """0: every second weighs the same; 1: every cell weighs the same."""
    max_ratio: Annotated[float, Range(1.0), Unit("of the mean second")]
    """Largest weight of a second over the mean weight of a second."""
    same_gait: Annotated[float, Range(0.0, 1.0), Unit("rad")]
    """Motions whose gait signatures differ by less than this [rad, root mean square] share a part of a cell."""
    smooth_jerk: MetresPerSecondCubed
    """Mean jerk [m/s^3] at which a clip's weight is halved."""
    missing_seconds: Annotated[float, POSITIVE, Unit("s")]
    """A cell with less than this [s] is missing."""


class BalanceError(PipelineError):
    """A table that weights can't be made of."""


def balance(rows: pd.DataFrame, settings: BalanceSettings, commands: CommandSettings) -> pd.DataFrame:
    """The rows with `weight` (MotionWeight: positive, finite, mean 1 over clips), `cell`, the one it is in for
    longest, and `family`, the name of the first motion of those it shares its part of a cell with.

    One row a clip. The result doesn't depend on the rows' order, which it keeps. Raises BalanceError where a
    column is missing, a clip is there twice or a number is not finite.
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
    """Coverage times diversity of a second of each row (n,) of a table by command with `cell` and `family`."""
    least, cell = limits.missing_seconds, spent["cell"].to_numpy()
    family_seconds = spent.groupby(["cell", "family"])["seconds"].transform("sum").to_numpy(dtype=float)
    cell_seconds = spent.groupby("cell")["seconds"].transform("sum").to_numpy(dtype=float)
    presence = np.minimum(family_seconds, least)
    share = presence * spent["seconds"].to_numpy(dtype=float) / family_seconds  # adds up to a family's presence
    cell_presence = pd.Series(share).groupby(cell).transform("sum").to_numpy(dtype=float)
    cell_weight = cell_seconds ** (1.0 - limits.cell_power) * np.minimum(cell_seconds / least, 1.0)
    return cell_weight * presence / cell_presence / family_seconds


def parents(rows: pd.DataFrame) -> pd.Series:
    """The motion each clip is a variant or a piece of: its `parent`, or its name up to `~` or `+`."""
    parent_of = rows["parent"] if "parent" in rows else pd.Series(index=rows.index, dtype=object)
    names = [
        re.split(r"[~+]", clip, maxsplit=1)[0] if pd.isna(parent) else parent
        for clip, parent in zip(rows["clip"], parent_of, strict=True)
    ]
    return pd.Series(names, index=rows.index)


def takes(rows: pd.DataFrame) -> Int[np.ndarray, " n"]:
    """A number for the clip of each row, the same for windows and pieces of one take."""
    return pd.factorize(rows["clip"].astype(object).str.replace(WITHIN_A_TAKE, "", regex=True))[0]


def effective_seconds_of(
    family: Int[np.ndarray, " n"],
    take: Int[np.ndarray, " n"],
    seconds: Float[np.ndarray, " n"],
    weight: Float[np.ndarray, " n"],
) -> float:
    """Seconds of different motion that weights make of the seconds of clips.

    (sum W)^2 / sum(W^2 / S) (Kish 1965) over families of weight W and S seconds of their own: those of the one take
    that has most. Equal to the sum of the S where every second of own motion weighs the same: copies add nothing, and
    a family that weighs too much for its seconds takes from the others.

    Args:
        family: a number for the family of each clip
        take: a number for the take of each clip: a recording or one variant of it (`takes`)
        seconds: of each clip
        weight: of each clip
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
    """Weights of a second (n,), none above `max_ratio` times the mean of all seconds."""
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
