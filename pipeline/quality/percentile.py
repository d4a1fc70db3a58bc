"""Percentiles that mean the same for a short motion as for a long one."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float


def percentile_of_least(values: Float[np.ndarray, " n"], percent: float, least: int) -> float:
    """Percentile of values that are 0 where there is no fault; fewer than `least` are filled up with zeros.

    Of 25 frames the 95th percentile is nearly the largest, so that one frame decides. Filled up to `least`, a short
    motion may have as many bad frames as one of that length, not fewer.
    """
    missing = max(least - values.size, 0)
    return float(np.percentile(np.concatenate([values.ravel(), np.zeros(missing)]), percent))
