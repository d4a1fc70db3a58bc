"""Which foot the plan holds still, and when."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from pipeline import time_series
from pipeline.clips.human_clip import FEET, HumanClip
from pipeline.retarget.settings import StanceSettings


def contacts_of(clip: HumanClip, settings: StanceSettings) -> Bool[np.ndarray, "t 2"]:
    """Frames in which the plan holds a foot still: the clip's own contacts and where the toe is low and slow."""
    labels = label(clip, settings)
    return labels if clip.contacts is None else labels | clip.contacts


def label(clip: HumanClip, settings: StanceSettings) -> Bool[np.ndarray, "t 2"]:
    """Frames in which the toe is low (over its 5th percentile) and slow."""
    columns = []
    for side in FEET:
        toe_pos_w = clip.pos(f"{side}_toe")
        speed = np.linalg.norm(time_series.derivative(toe_pos_w, clip.fps), axis=-1)
        height = toe_pos_w[:, 2] - np.percentile(toe_pos_w[:, 2], 5.0)
        low_and_slow = (height < settings.toe_height) & (speed < settings.toe_speed_m_s)
        columns.append(without_short_runs(low_and_slow, max(1, round(settings.shortest_s * clip.fps))))
    return np.stack(columns, axis=-1)


def without_short_runs(label: Bool[np.ndarray, " t"], shortest: int) -> Bool[np.ndarray, " t"]:
    """`label` with inner gaps shorter than `shortest` frames closed, then runs shorter than that dropped."""
    result = label.copy()
    for start, stop in time_series.runs(~result):
        if stop - start < shortest and start > 0 and stop < len(label):
            result[start:stop] = True
    for start, stop in time_series.runs(result):
        if stop - start < shortest and start > 0 and stop < len(label):
            result[start:stop] = False
    return result
