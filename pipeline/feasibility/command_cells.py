"""The cells of the command space: which one a clip's velocity lies in."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.feasibility.settings import CommandSettings

STANDING = "standing"


def cell_edges(axis: tuple[float, float, float]) -> np.ndarray:
    """Edges of an axis given as lowest, highest and width."""
    low, high, width = axis
    return low + width * np.arange(round((high - low) / width) + 1)


def cell_of(rows: pd.DataFrame, settings: CommandSettings) -> pd.Series:
    """Name of each clip's cell: `standing`, or the forward, lateral and yaw index as `f3 l2 y4`.

    Velocities outside the ranges go to the outermost cells, so that no clip is without one.
    """
    speed = np.hypot(rows["forward_m_s"], rows["lateral_m_s"])
    standing = (speed < settings.standing_m_s) & (rows["yaw_rate_rad_s"].abs() < settings.standing_rad_s)
    parts = []
    axes = (
        ("f", "forward_m_s", settings.forward),
        ("l", "lateral_m_s", settings.lateral),
        ("y", "yaw_rate_rad_s", settings.yaw_rate),
    )
    for letter, column, axis in axes:
        parts.append(letter + pd.Series(axis_index(rows[column].to_numpy(), axis), index=rows.index).astype(str))
    return (parts[0] + " " + parts[1] + " " + parts[2]).where(~standing, STANDING)


def axis_index(values: np.ndarray, axis: tuple[float, float, float]) -> np.ndarray:
    """Cell of each value on an axis, the outermost ones open to the outside."""
    edges = cell_edges(axis)
    return np.clip(np.searchsorted(edges, np.asarray(values, dtype=float) + 1e-9, side="right") - 1, 0, len(edges) - 2)
