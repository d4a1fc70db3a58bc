"""What of a window goes on: gaps too long to fill and cuts divide it into stretches."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from pipeline import time_series
from pipeline.repair.defect import Findings
from pipeline.repair.settings import RepairSettings
from pipeline.repair.tree import Positions

COMEBACK_SPEED = 2.0
"""A gap of the whole body is filled if the way across took at most this many times the clip's usual top speed."""
SLACK = 0.05
"""Way that is always allowed across a gap [m]."""


@dataclass(frozen=True, kw_only=True)
class Division:
    """A clip after its defects."""

    dropped: Bool[np.ndarray, " t"]
    """Frames that are not filled."""
    filled: Bool[np.ndarray, " t"]
    """Frames in which something was filled."""
    stretches: tuple[tuple[int, int], ...]
    """Frame ranges without a dropped frame and without a cut inside."""


def divide(pos_w: Positions, findings: Findings, fps: float, settings: RepairSettings) -> Division:
    """Gaps that are too long, touch an end of the clip or lead somewhere else are dropped, the others filled."""
    count = findings.frame_count
    lost = findings.lost
    longest = int(np.floor(settings.fill.longest_gap_s * fps + 1e-6))
    dropped = np.zeros(count, dtype=bool)
    for index in np.flatnonzero(lost.any(axis=0)):
        for start, stop in time_series.runs(lost[:, index]):
            if stop - start > longest or start == 0 or stop == count:
                dropped[start:stop] = True
    whole = lost[:, 0]
    good = np.flatnonzero(~whole)
    step = np.linalg.norm(np.diff(pos_w[good, 0], axis=0), axis=1) / np.diff(good)
    top = float(np.percentile(step, 95)) if len(step) else 0.0
    for start, stop in time_series.runs(whole & ~dropped):
        way = np.linalg.norm(pos_w[stop, 0] - pos_w[start - 1, 0])
        if way > COMEBACK_SPEED * top * (stop - start + 1) + SLACK:
            dropped[start:stop] = True
    edges = sorted({0, count, *findings.cuts})
    stretches = [
        (low + start, low + stop)
        for low, high in itertools.pairwise(edges)
        for start, stop in time_series.runs(~dropped[low:high])
    ]
    return Division(dropped=dropped, filled=lost.any(axis=1) & ~dropped, stretches=tuple(stretches))
