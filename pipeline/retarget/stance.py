"""Which foot the plan holds still, and when."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from pipeline import rotation, time_series
from pipeline.clips.human_clip import FEET, HumanClip
from pipeline.retarget.settings import StanceSettings


def contacts_of(clip: HumanClip, settings: StanceSettings) -> Bool[np.ndarray, "t 2"]:
    """Frames in which the plan holds a foot still: the clip's own contacts and where the toe is low and slow."""
    labels = low_and_slow(clip, settings)
    if clip.contacts is not None:
        labels = labels | clip.contacts
    shortest, swing = (max(1, round(time_s * clip.fps)) for time_s in (settings.shortest_s, settings.shortest_swing_s))
    return np.stack([without_short_runs(labels[:, side], shortest, swing) for side in range(2)], axis=-1)


def low_and_slow(clip: HumanClip, settings: StanceSettings) -> Bool[np.ndarray, "t 2"]:
    """Frames in which the toe is low (over its 5th percentile) and slow."""
    columns = []
    for side in FEET:
        toe_pos_w = clip.pos(f"{side}_toe")
        speed = rotation.length(time_series.derivative(toe_pos_w, clip.fps))
        height = toe_pos_w[:, 2] - np.percentile(toe_pos_w[:, 2], 5.0)
        columns.append((height < settings.toe_height) & (speed < settings.toe_speed_m_s))
    return np.stack(columns, axis=-1)


def without_short_runs(label: Bool[np.ndarray, " t"], shortest: int, swing: int) -> Bool[np.ndarray, " t"]:
    """`label` with inner gaps shorter than `swing` frames closed, then inner runs shorter than `shortest` dropped."""
    result = label.copy()
    for length, wanted in ((swing, False), (shortest, True)):
        for start, stop in time_series.runs(result == wanted):
            if stop - start < length and start > 0 and stop < len(label):
                result[start:stop] = not wanted
    return result
