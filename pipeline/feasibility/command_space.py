"""The command space: its cells, over which weights are balanced, and the histogram of a motion's velocities.

The mean velocity does not describe a clip that stands, walks and turns. Each clip therefore has a text
`command_seconds`: JSON, a list of [forward m/s, lateral m/s, yaw rate rad/s, seconds], one entry for the centre of each
box of the command space that it visits. Boxes are half as wide as the cells of the coverage report and have an edge at
0, so that cells centred at 0 and cells starting at 0 are both sums of boxes.
"""

import json
from dataclasses import dataclass
from typing import Annotated

import msgspec
import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from pipeline.files.ranges import NOT_NEGATIVE, Remark
from pipeline.files.sourced import Unit

STANDING = "standing"

Axis = tuple[float, float, float]
"""Lower bound, upper bound and cell width."""

BOX = np.array([0.1, 0.1, 0.25])
"""Width of a box: forward [m/s], lateral [m/s], yaw rate [rad/s]."""

SECONDS_COLUMN = "command_seconds"

VELOCITIES = ("forward_m_s", "lateral_m_s", "yaw_rate_rad_s")


class WholeCells(Remark):
    """Check that an axis consists of one or more whole cells."""

    def faults(self, where: str, value: Axis) -> list[tuple[str, str]]:
        low, high, width = value
        cells = (high - low) / width if width > 0.0 else 0.0
        if 0.5 < cells < 1_000.5 and abs(cells - round(cells)) < 1e-6:
            return []
        return [(where, f"is {low:g} to {high:g} in cells of {width:g}, allowed are 1 to 1000 whole cells")]


@dataclass(frozen=True, kw_only=True)
class CommandSettings:
    """`data/commands.yaml`: the cells of the command space, used by weights and feedback."""

    forward: Annotated[Axis, WholeCells(), Unit("m/s")]
    """Lower bound, upper bound and cell width of the forward velocity [m/s]."""
    lateral: Annotated[Axis, WholeCells(), Unit("m/s")]
    """Lower bound, upper bound and cell width of the lateral velocity [m/s]."""
    yaw_rate: Annotated[Axis, WholeCells(), Unit("rad/s")]
    """Lower bound, upper bound and cell width of the yaw rate [rad/s]."""
    standing_m_s: Annotated[float, NOT_NEGATIVE, Unit("m/s")]
    """Horizontal speed below which a motion may be standing [m/s]."""
    standing_rad_s: Annotated[float, NOT_NEGATIVE, Unit("rad/s")]
    """Yaw rate below which a motion may be standing [rad/s]."""


def standing(rows: pd.DataFrame, settings: CommandSettings) -> np.ndarray:
    """Mask (n,) of the rows that are standing: speed and yaw rate below both limits."""
    speed = np.hypot(rows["forward_m_s"].to_numpy(dtype=float), rows["lateral_m_s"].to_numpy(dtype=float))
    turning = np.abs(rows["yaw_rate_rad_s"].to_numpy(dtype=float))
    return (speed < settings.standing_m_s) & (turning < settings.standing_rad_s)


def cell_of(rows: pd.DataFrame, settings: CommandSettings) -> pd.Series:
    """Name of each row's cell: `standing`, or the middle of its cell: `0.6 m/s, 0.0 m/s, -0.5 rad/s`.

    Cells are centred at multiples of their width, so that sway around 0 does not split a straight walk. Velocities
    outside the ranges belong to the outermost cells.
    """
    middles = [
        (_middle(rows["forward_m_s"].to_numpy(dtype=float), settings.forward), "m/s"),
        (_middle(rows["lateral_m_s"].to_numpy(dtype=float), settings.lateral), "m/s"),
        (_middle(rows["yaw_rate_rad_s"].to_numpy(dtype=float), settings.yaw_rate), "rad/s"),
    ]
    texts = []
    for values, unit in middles:
        distinct, place = np.unique(values, return_inverse=True)
        texts.append(np.array([f"{value:.1f} {unit}" for value in distinct], dtype=object)[place])
    names = pd.Series([", ".join(parts) for parts in zip(*texts, strict=True)], index=rows.index, dtype=object)
    return names.where(~standing(rows, settings), STANDING)


def _middle(values: np.ndarray, axis: Axis) -> np.ndarray:
    low, high, width = axis
    nearest = np.floor(values / width + 0.5 + 1e-9) * width
    return np.clip(nearest, low, high) + 0.0


def command_seconds_text(commands: Float[np.ndarray, "t 3"], fps: float) -> str:
    """`command_seconds` of a motion with velocities (t, 3): seconds in each visited box, sorted by box."""
    boxes = np.floor(commands / BOX + 1e-9).astype(int)
    boxes, frames = _distinct(boxes)
    middles = np.round((boxes + 0.5) * BOX, 3)
    seconds = np.round(frames / fps, 3)
    return json.dumps(np.column_stack([middles, seconds]).tolist())


def _distinct(boxes: Int[np.ndarray, "t 3"]) -> tuple[Int[np.ndarray, "n 3"], Int[np.ndarray, " n"]]:
    """Distinct boxes, sorted, and their counts."""
    low = boxes.min(axis=0)
    _, lateral, yaw = boxes.max(axis=0) - low + 1
    numbered = (boxes - low) @ np.array([lateral * yaw, yaw, 1])
    _, first, count = np.unique(numbered, return_index=True, return_counts=True)
    return boxes[first], count


def by_command(rows: pd.DataFrame) -> pd.DataFrame:
    """One row for each box that a clip visits, with the box's velocities and seconds and the clip's other columns
    (without `command_seconds`).

    Seconds are scaled so that they sum to the clip's seconds. Clips without `command_seconds` have one row with their
    mean velocities. `clip_seconds` is the clip's seconds, `row` its index in the input.
    """
    carried = rows[SECONDS_COLUMN] if SECONDS_COLUMN in rows else pd.Series(None, index=rows.index, dtype=object)
    places, values = [], []
    means = rows[list(VELOCITIES)].to_numpy(dtype=float)
    seconds = rows["seconds"].to_numpy(dtype=float)
    for place, text in enumerate(carried):
        spent = np.array(msgspec.json.decode(text)) if isinstance(text, str) else np.append(means[place], 1.0)[None]
        spent[:, 3] *= seconds[place] / spent[:, 3].sum()
        places += [place] * len(spent)
        values.append(spent)
    found = rows.drop(columns=SECONDS_COLUMN, errors="ignore").iloc[places].reset_index(drop=True)
    table = np.concatenate(values) if values else np.zeros((0, 4))
    found = found.assign(row=places, clip_seconds=found["seconds"].astype(float), seconds=table[:, 3])
    return found.assign(**{name: table[:, column] for column, name in enumerate(VELOCITIES)})
