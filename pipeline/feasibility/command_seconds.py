"""How long a motion moves at which velocity: a clip may stand, walk and turn, and its mean would be none of it.

A clip carries it as one text, `command_seconds`: JSON, a list of [forward m/s, lateral m/s, yaw rate rad/s, seconds],
a line a box of the command space that it visits, by the box's middle. Boxes are half as wide as the cells of the
coverage report and have an edge at 0, so that cells about 0 and cells from 0 on can both be added up from them.
"""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
from jaxtyping import Float

BOX = np.array([0.1, 0.1, 0.25])
"""Width of a box: forward [m/s], lateral [m/s], yaw rate [rad/s]."""

COLUMN = "command_seconds"

VELOCITIES = ("forward_m_s", "lateral_m_s", "yaw_rate_rad_s")


def command_seconds_text(commands: Float[np.ndarray, "t 3"], fps: float) -> str:
    """The text of a motion: seconds of its frames in each box they lie in, in the boxes' order."""
    boxes, frames = np.unique(np.floor(commands / BOX + 1e-9).astype(int), axis=0, return_counts=True)
    middles = np.round((boxes + 0.5) * BOX, 3)
    seconds = np.round(frames / fps, 3)
    return json.dumps(np.column_stack([middles, seconds]).tolist())


def by_command(rows: pd.DataFrame) -> pd.DataFrame:
    """A row for each box a clip visits, with its velocities and seconds; the other columns are the clip's.

    Seconds are scaled so that a clip's add up to its own. Clips that don't carry `command_seconds` keep one row with
    their mean velocities. `clip_seconds` holds the clip's own seconds, `row` its place in the table.
    """
    carried = rows[COLUMN] if COLUMN in rows else pd.Series(None, index=rows.index, dtype=object)
    places, values = [], []
    means = rows[list(VELOCITIES)].to_numpy(dtype=float)
    seconds = rows["seconds"].to_numpy(dtype=float)
    for place, text in enumerate(carried):
        spent = np.array(json.loads(text)) if isinstance(text, str) else np.append(means[place], 1.0)[None]
        spent[:, 3] *= seconds[place] / spent[:, 3].sum()
        places += [place] * len(spent)
        values.append(spent)
    found = rows.iloc[places].reset_index(drop=True)
    table = np.concatenate(values) if values else np.zeros((0, 4))
    found = found.assign(row=places, clip_seconds=found["seconds"].astype(float), seconds=table[:, 3])
    return found.assign(**{name: table[:, column] for column, name in enumerate(VELOCITIES)})
