"""The cells of the command space that weights are balanced over."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.feasibility.command_settings import CommandSettings

STANDING = "standing"

Axis = tuple[float, float, float]
"""Lowest, highest and width of cells."""


def standing(rows: pd.DataFrame, settings: CommandSettings) -> np.ndarray:
    """Rows (n,) that are slower than standing allows, in every direction."""
    speed = np.hypot(rows["forward_m_s"].to_numpy(dtype=float), rows["lateral_m_s"].to_numpy(dtype=float))
    turning = np.abs(rows["yaw_rate_rad_s"].to_numpy(dtype=float))
    return (speed < settings.standing_m_s) & (turning < settings.standing_rad_s)


def cell_of(rows: pd.DataFrame, settings: CommandSettings) -> pd.Series:
    """Name of each row's cell: `standing`, or the middle of its cell: `0.6 m/s, 0.0 m/s, -0.5 rad/s`.

    Cells lie about the multiples of their width, so that sway about 0 doesn't split a straight walk. Velocities outside
    the ranges go to the outermost cells: no row is without one.
    """
    middles = [
        (_middle(rows["forward_m_s"].to_numpy(dtype=float), settings.forward), "m/s"),
        (_middle(rows["lateral_m_s"].to_numpy(dtype=float), settings.lateral), "m/s"),
        (_middle(rows["yaw_rate_rad_s"].to_numpy(dtype=float), settings.yaw_rate), "rad/s"),
    ]
    texts = [[f"{value:.1f} {unit}" for value in values] for values, unit in middles]
    names = pd.Series([", ".join(parts) for parts in zip(*texts, strict=True)], index=rows.index, dtype=object)
    return names.where(~standing(rows, settings), STANDING)


def _middle(values: np.ndarray, axis: Axis) -> np.ndarray:
    low, high, width = axis
    nearest = np.floor(values / width + 0.5 + 1e-9) * width
    return np.clip(nearest, low, high) + 0.0
