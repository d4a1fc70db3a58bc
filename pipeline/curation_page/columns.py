"""The table in columns for the browser: texts as indices into a list of names, figures rounded to four digits."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pandas as pd

from pipeline.curation_page.clip_table import STAGES, VERDICTS, ClipRow, ClipTable
from pipeline.feasibility.criterion import REGISTERED, codes
from pipeline.selection.curation import Decision

FACETS = ("source", "skill", "licence")
"""Text columns for filters."""

THRESHOLD_COLUMNS = ("criterion", "threshold")
"""Columns of the criteria table that the gallery needs."""

OTHER_FIGURES: Mapping[str, tuple[str, str]] = {
    "seconds": ("length", "s"),
    "weight": ("database", ""),
    "forward_m_s": ("command", "m/s"),
    "lateral_m_s": ("command", "m/s"),
    "yaw_rate_rad_s": ("command", "rad/s"),
    "stance_slip_m_s": ("person", "m/s"),
    "speed_mean": ("person", "m/s"),
    "recorded_share": ("person", ""),
    "slip_m_s": ("retargeting", "m/s"),
    "penetration_m": ("retargeting", "m"),
    "height_shift_m": ("retargeting", "m"),
    "limb_error_deg": ("retargeting", "deg"),
    "times_its_bar": ("retargeting", ""),
    "body_error_m": ("rollout", "m"),
    "joint_error_rad": ("rollout", "rad"),
    "path_error_m": ("rollout", "m"),
    "largest_push_n_s": ("rollout", "N s"),
    "friction": ("rollout", ""),
}
"""Figures that are not criteria -> group and unit."""


def columns(table: ClipTable, criteria: pd.DataFrame | None, decisions: Iterable[Decision]) -> dict[str, Any]:
    """The table for the browser as JSON types.

    Args:
        table: table of all clips
        criteria: KP5's criteria table, for the thresholds; None without one
        decisions: decisions on clips
    """
    rows = table.rows
    decided = {each.clip: each for each in decisions}
    texts = {name: _coded([str(row.numbers.get(name) or "") for row in rows]) for name in FACETS}
    texts["stage"] = _coded([row.stage for row in rows], STAGES)
    texts["verdict"] = _coded([row.verdict for row in rows], VERDICTS)
    texts["reason"] = _coded([_first_rejection(row) for row in rows])
    texts["decision"] = _coded([decided[row.clip].verdict if row.clip in decided else "" for row in rows])
    return {
        "clip": [row.clip for row in rows],
        "texts": texts,
        "figures": _figures(rows, criteria),
    }


def _figures(rows: Sequence[ClipRow], criteria: pd.DataFrame | None) -> list[dict[str, Any]]:
    """All figures that at least one clip has, criteria first.

    `lower`: whether small values are bad. `thresholds`: smallest and largest threshold of all clips, because some
    thresholds depend on speed; None if the figure is not a criterion.
    """
    limits = _thresholds(criteria)
    known: dict[str, tuple[str, str, bool]] = {
        code: (REGISTERED[code].group, REGISTERED[code].unit, REGISTERED[code].lower) for code in codes()
    }
    for name, (group, unit) in OTHER_FIGURES.items():
        known.setdefault(name, (group, unit, False))
    found = []
    for name, (group, unit, lower) in known.items():
        values = _values(rows, name)
        if values is not None:
            facts = {"name": name, "group": group, "unit": unit, "lower": lower}
            found.append({**facts, "thresholds": limits.get(name), "values": values})
    return found


def _values(rows: Sequence[ClipRow], name: str) -> list[float | None] | None:
    """Values of a figure for all clips; None if no clip has it."""
    values = [_rounded(row.numbers.get(name)) for row in rows]
    return values if any(value is not None for value in values) else None


def _rounded(value: Any) -> float | None:
    if value is None or not isinstance(value, (int, float)) or isinstance(value, bool) or not math.isfinite(value):
        return None
    return float(f"{value:.4g}")


def _thresholds(criteria: pd.DataFrame | None) -> dict[str, list[float]]:
    """Criterion -> smallest and largest threshold."""
    if criteria is None or criteria.empty:
        return {}
    known = criteria[list(THRESHOLD_COLUMNS)].dropna()
    limits = known["threshold"].groupby(known["criterion"], observed=True).agg(["min", "max"])
    return {str(code): [float(low), float(high)] for code, low, high in limits.itertuples()}


def _coded(values: list[str], names: Sequence[str] = ()) -> dict[str, Any]:
    """Encode texts as indices into a list of names: `names` first, then the others sorted."""
    known = {name: place for place, name in enumerate(dict.fromkeys([*names, *sorted(set(values))]))}
    return {"names": list(known), "codes": [known[value] for value in values]}


def _first_rejection(row: ClipRow) -> str:
    """Code of the first reason with the effect `rejected`."""
    return next((str(reason["code"]) for reason in row.reasons if reason.get("effect") == "rejected"), "")
