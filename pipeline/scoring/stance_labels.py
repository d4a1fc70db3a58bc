"""Stance labels from the human's toes at three strictnesses.

The thresholds are those of the published comparison of retargeting onto T1, so that figures are comparable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from pipeline import time_series
from pipeline.clips.human_clip import FEET, HumanClip

LOW_PERCENTILE = 5.0
"""Percentile of a toe's height that counts as the ground."""

VERTICAL_SPEED_M_S = 0.4
"""Vertical speed above which a toe is not in stance."""

MEDIAN_S = 5.0 / 30.0
"""Width of the median that labels are smoothed with [s]: five frames at 30 Hz."""


@dataclass(frozen=True, kw_only=True)
class Strictness:
    """Limits below which a toe is in stance."""

    height: float
    """Height over the toe's `LOW_PERCENTILE` [m]."""
    speed_m_s: float
    """Horizontal speed [m/s]."""


STRICTNESSES = {
    "strict": Strictness(height=0.015, speed_m_s=0.20),
    "middle": Strictness(height=0.025, speed_m_s=0.45),
    "loose": Strictness(height=0.04, speed_m_s=0.8),
}


def stance_labels(human: HumanClip, strictness: Strictness) -> Bool[np.ndarray, "t 2"]:
    """Frames in stance of the left and right foot: toe low and slow, then a median over time."""
    width = 2 * round((MEDIAN_S * human.fps - 1.0) / 2.0) + 1
    columns = []
    for side in FEET:
        toe_w = human.pos(f"{side}_toe")
        velocity = time_series.derivative(toe_w, human.fps)
        label = toe_w[:, 2] < np.percentile(toe_w[:, 2], LOW_PERCENTILE) + strictness.height
        label &= np.linalg.norm(velocity[:, :2], axis=1) < strictness.speed_m_s
        label &= np.abs(velocity[:, 2]) < VERTICAL_SPEED_M_S
        columns.append(time_series.moving_mean(label.astype(float), width) > 0.5)
    return np.stack(columns, axis=1)
