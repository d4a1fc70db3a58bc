"""The table as columns for the browser: texts as an index into a list, figures as numbers with four digits."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from pipeline.curation_page.clip_table import STAGES, VERDICTS, ClipRow, ClipTable
from pipeline.feasibility.criterion import REGISTERED, codes
from pipeline.selection.curation import Decision

FACETS = ("source", "skill", "licence")
"""Texts of a clip that can be filtered."""

THRESHOLD_COLUMNS = ("criterion", "threshold")
"""Columns of the table of criteria that are read here."""

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
"""Figures that are no criteria -> group and unit."""


@dataclass(frozen=True, kw_only=True)
class FigureColumn:
    """One figure of all clips."""

    name: str
    group: str
    unit: str
    lower: bool
    """Whether small values are bad."""
    thresholds: tuple[float, float] | None
    """Smallest and largest threshold that clips were compared with; some depend on the speed. None: no criterion."""
    values: tuple[float | None, ...]

    def to_dict(self) -> dict[str, Any]:
        """JSON types."""
        return {**vars(self), "thresholds": list(self.thresholds) if self.thresholds else None}


def columns(table: ClipTable, criteria: pd.DataFrame | None, decisions: Iterable[Decision]) -> dict[str, Any]:
    """The table in the form that the browser reads; equal tables give equal values.

    Args:
        criteria: KP5's table of criteria, for the thresholds; None where there is none
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
        "figures": [each.to_dict() for each in figure_columns(rows, criteria)],
    }


def figure_columns(rows: Sequence[ClipRow], criteria: pd.DataFrame | None) -> list[FigureColumn]:
    """All figures that any clip has, criteria first, in the order of the tables."""
    limits = _thresholds(criteria)
    found = []
    for code in codes():
        entry = REGISTERED[code]
        values = _values(rows, code)
        if any(value is not None for value in values):
            known = limits.get(code)
            found.append(
                FigureColumn(
                    name=code,
                    group=entry.group,
                    unit=entry.unit,
                    lower=entry.lower,
                    thresholds=known,
                    values=values,
                )
            )
    named = {each.name for each in found}
    for name, (group, unit) in OTHER_FIGURES.items():
        values = _values(rows, name)
        if name not in named and any(value is not None for value in values):
            found.append(FigureColumn(name=name, group=group, unit=unit, lower=False, thresholds=None, values=values))
    return found


def _values(rows: Sequence[ClipRow], name: str) -> tuple[float | None, ...]:
    found = [row.numbers.get(name) for row in rows]
    return tuple(map(_short, found)) if any(value is not None for value in found) else (None,) * len(found)


def _short(value: Any) -> float | None:
    if value is None or not isinstance(value, (int, float)) or isinstance(value, bool) or not math.isfinite(value):
        return None
    return float(f"{value:.4g}")


def _thresholds(criteria: pd.DataFrame | None) -> dict[str, tuple[float, float]]:
    """Criterion -> smallest and largest threshold."""
    if criteria is None or criteria.empty:
        return {}
    known = criteria[list(THRESHOLD_COLUMNS)].dropna()
    place, names = pd.factorize(known["criterion"])
    limits = known["threshold"].to_numpy(dtype=float)
    low, high = np.full(len(names), np.inf), np.full(len(names), -np.inf)
    np.minimum.at(low, place, limits)
    np.maximum.at(high, place, limits)
    return {str(code): (float(low[index]), float(high[index])) for index, code in enumerate(names)}


def _coded(values: list[str], names: Sequence[str] = ()) -> dict[str, Any]:
    """Texts as their place in a list of names, which are in order; given ones first."""
    known = {name: place for place, name in enumerate(dict.fromkeys([*names, *sorted(set(values))]))}
    return {"names": list(known), "codes": [known[value] for value in values]}


def _first_rejection(row: ClipRow) -> str:
    """Code of the first reason that rejected something of the clip."""
    return next((str(reason["code"]) for reason in row.reasons if reason.get("effect") == "rejected"), "")
