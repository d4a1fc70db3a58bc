"""How many seconds each part of the command space has, and what is missing, in words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.feasibility.balance import effective_seconds
from pipeline.feasibility.command_cells import STANDING, axis_index, cell_edges, cell_of
from pipeline.feasibility.settings import BalanceSettings, CommandSettings, FeasibilitySettings

NEEDED = ("seconds", "forward_m_s", "lateral_m_s", "yaw_rate_rad_s")
"""Columns that are looked at; `weight` too where it is there."""


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """Seconds on the axes of the command space and on its plane of forward speed and yaw rate."""

    cells: pd.DataFrame
    """A row a cell: `axis` (`standing, forward, lateral, yaw, forward_yaw`), `low` and `high` of the first
    quantity, `low_2` and `high_2` of the second (plane alone), `seconds`, `clips` and, where
    the rows have weights, `weight` and `effective_seconds`: what the seconds count for as they are weighted."""
    missing: tuple[str, ...]
    """A sentence for each stretch of an axis that has too little."""


def coverage(rows: pd.DataFrame, settings: FeasibilitySettings) -> Coverage:
    """Coverage of the paper's command ranges by clips with their mean velocities.

    An axis has the clips whose other velocities lie in the middle of the range: within one cell's width of 0.
    Clips outside the ranges count for no cell.
    """
    commands = settings.balance.commands
    if rows.empty:
        rows = pd.DataFrame({name: pd.Series(dtype=float) for name in NEEDED})
    standing = cell_of(rows, commands) == STANDING
    tables = [_row(STANDING, 0.0, 0.0, _only(rows, standing))]
    straight = {
        "forward": (_near(rows, "lateral_m_s", commands.lateral) & _near(rows, "yaw_rate_rad_s", commands.yaw_rate)),
        "lateral": (_near(rows, "forward_m_s", commands.forward) & _near(rows, "yaw_rate_rad_s", commands.yaw_rate)),
        "yaw": (_near(rows, "forward_m_s", commands.forward) & _near(rows, "lateral_m_s", commands.lateral)),
    }
    for axis, column, limits in _axes(commands):
        tables += _axis_rows(axis, _only(rows, straight[axis] & ~standing), column, limits)
    tables += _plane_rows(_only(rows, _near(rows, "lateral_m_s", commands.lateral) & ~standing), commands)
    cells = pd.DataFrame(tables)
    return Coverage(cells=cells, missing=_missing(cells, settings.balance))


def _axes(commands: CommandSettings) -> tuple[tuple[str, str, tuple[float, float, float]], ...]:
    return (
        ("forward", "forward_m_s", commands.forward),
        ("lateral", "lateral_m_s", commands.lateral),
        ("yaw", "yaw_rate_rad_s", commands.yaw_rate),
    )


def _only(rows: pd.DataFrame, wanted: pd.Series | np.ndarray) -> pd.DataFrame:
    """Rows where `wanted` (n,) holds."""
    return rows.loc[np.asarray(wanted, dtype=bool)]


def _near(rows: pd.DataFrame, column: str, axis: tuple[float, float, float]) -> pd.Series:
    return pd.Series(np.abs(rows[column].to_numpy(dtype=float)) <= axis[2], index=rows.index)


def _axis_rows(name: str, rows: pd.DataFrame, column: str, axis: tuple[float, float, float]) -> list[dict]:
    edges = cell_edges(axis)
    inside = _only(rows, rows[column].between(axis[0], axis[1]))
    index = axis_index(inside[column].to_numpy(), axis)
    return [_row(name, edges[cell], edges[cell + 1], _only(inside, index == cell)) for cell in range(len(edges) - 1)]


def _plane_rows(rows: pd.DataFrame, commands: CommandSettings) -> list[dict]:
    edges = cell_edges(commands.yaw_rate)
    inside = _only(rows, rows["yaw_rate_rad_s"].between(commands.yaw_rate[0], commands.yaw_rate[1]))
    index = axis_index(inside["yaw_rate_rad_s"].to_numpy(), commands.yaw_rate)
    found = []
    for cell in range(len(edges) - 1):
        limits = {"low_2": float(edges[cell]), "high_2": float(edges[cell + 1])}
        line = _axis_rows("forward_yaw", _only(inside, index == cell), "forward_m_s", commands.forward)
        found += [{**entry, **limits} for entry in line]
    return found


def _row(axis: str, low: float, high: float, rows: pd.DataFrame) -> dict:
    entry = {
        "axis": axis,
        "low": float(np.round(low, 9)),
        "high": float(np.round(high, 9)),
        "low_2": np.nan,
        "high_2": np.nan,
        "seconds": float(np.sum(rows["seconds"].to_numpy(dtype=float))),
        "clips": len(rows),
    }
    if "weight" in rows:
        entry["weight"] = float(np.sum(rows["weight"].to_numpy(dtype=float)))
        entry["effective_seconds"] = effective_seconds(
            rows["seconds"].to_numpy(dtype=float), rows["weight"].to_numpy(dtype=float)
        )
    return entry


_SENTENCES: dict[str, Callable[[float, float], str]] = {
    "forward": lambda low, high: (
        f"walks forward at {low:.1f} to {high:.1f} m/s"
        if low >= 0
        else f"walks back at {abs(high):.1f} to {-low:.1f} m/s"
    ),
    "lateral": lambda low, high: (
        f"walks left at {low:.1f} to {high:.1f} m/s"
        if low >= 0
        else f"walks right at {abs(high):.1f} to {-low:.1f} m/s"
    ),
    "yaw": lambda low, high: (
        f"turns left at {low:.1f} to {high:.1f} rad/s"
        if low >= 0
        else f"turns right at {abs(high):.1f} to {-low:.1f} rad/s"
    ),
}


def _missing(cells: pd.DataFrame, settings: BalanceSettings) -> tuple[str, ...]:
    """Neighbouring empty cells of one direction are one sentence; the cells about 0 are covered by standing."""
    least = settings.missing_seconds
    sentences = []
    if cells.loc[cells["axis"] == STANDING, "seconds"].sum() < least:
        sentences.append(f"No clip stands for {least:g} s.")
    for axis in ("forward", "lateral", "yaw"):
        line = _only(cells, cells["axis"].to_numpy() == axis).sort_values(by="low")
        for side in (line[line["low"] >= -1e-9], line[line["low"] < -1e-9]):
            spans: list[list[float]] = []
            for low, high, seconds in zip(side["low"], side["high"], side["seconds"], strict=True):
                if seconds >= least:
                    continue
                if spans and abs(spans[-1][1] - low) < 1e-6:
                    spans[-1][1] = high
                else:
                    spans.append([low + 0.0, high + 0.0])
            sentences += [f"No clip {_SENTENCES[axis](low, high)}." for low, high in spans]
    return tuple(sentences)
