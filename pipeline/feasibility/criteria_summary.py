"""The table of criteria seen from afar: how often each is broken, and what came nearest to its threshold."""

from __future__ import annotations

from typing import Any

import pandas as pd

from pipeline.feasibility.criteria import GROUP_OF
from pipeline.feasibility.criteria_table import BROKEN, NOT_APPLICABLE

BY_CRITERION = (
    *("group", "criterion", "clips", "broken", "not applicable"),
    *("closest margin", "closest number", "threshold", "unit", "closest clip", "setting", "source", "why"),
)
"""Columns of `by_criterion`. Threshold and where it comes from are the closest stretch's."""

ORIGIN = ("unit", "setting", "source", "why")
"""Columns that say where a threshold comes from."""

MARGINS = (
    *("clip", "start_s", "stop_s", "piece", "group", "criterion", "verdict"),
    *("number", "threshold", "unit", "margin", "source", "said"),
)
"""Columns of `worst_margins`."""


def by_criterion(table: pd.DataFrame) -> pd.DataFrame:
    """A row a criterion: how many clips there are, in how many some stretch broke it, in how many it did not apply, and
    the stretch that went on with least to spare."""
    rows = []
    for code in [*GROUP_OF, *sorted(set(table["criterion"]) - set(GROUP_OF))]:
        own = table.query("criterion == @code")
        if own.empty:
            continue
        broken = set(own.loc[own["verdict"] == BROKEN, "clip"])
        silent = set(own.loc[own["verdict"] == NOT_APPLICABLE, "clip"]) - set(
            own.loc[own["verdict"] != NOT_APPLICABLE, "clip"]
        )
        first = own.iloc[0]
        row = {"group": first["group"], "criterion": code, "clips": own["clip"].nunique(), "broken": len(broken)}
        rows.append({**row, "not applicable": len(silent), **first[list(ORIGIN)], **_closest(own)})
    return pd.DataFrame(rows, columns=list(BY_CRITERION))


def worst_margins(table: pd.DataFrame) -> pd.DataFrame:
    """Rows by their margin, the worst first; what was not asked is left out."""
    asked = table.loc[table["verdict"] != NOT_APPLICABLE, list(MARGINS)]
    return asked.sort_values(by=["margin", "clip", "start_s", "criterion"], na_position="first")


def _closest(own: pd.DataFrame) -> dict[str, Any]:
    """The stretch that went on with the smallest margin to one criterion."""
    kept = own.query("piece != '' and verdict == 'holds'").dropna(subset=["margin"])
    if kept.empty:
        return {}
    row = kept.sort_values(by=["margin", "piece"]).iloc[0]
    found = {"closest margin": row["margin"], "closest number": row["number"], "threshold": row["threshold"]}
    return {**found, "closest clip": row["piece"], **row[list(ORIGIN)]}
