"""Optimal segmentation of a clip into stretches of one label with least lengths.

Every frame has a cost for every label and every cut has a price. The optimum over all segmentations is found by
dynamic programming (Viterbi with a least duration a label), so no gap has to be merged afterwards and a stretch
ends where that is cheapest, not where a threshold was crossed first.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int


def segment(
    cost: Float[np.ndarray, "t k"], shortest: Int[np.ndarray, " k"], cut_price: float
) -> list[tuple[int, int, int]]:
    """Stretches `(start, stop, label)` that tile the frames, in order; neighbours differ in label.

    Args:
        cost: cost of each label at each frame
        shortest: least number of frames of a stretch of each label
        cut_price: price of one cut, in the unit of the costs

    A clip too short for any label's least length gives one stretch of the label that is cheapest throughout.
    """
    count, labels = cost.shape
    if count < shortest.min():
        return [(0, count, int(np.argmin(cost.sum(axis=0))))]
    total = np.concatenate([np.zeros((1, labels)), np.cumsum(cost, axis=0)])
    best = np.full((count + 1, labels), np.inf)
    start = np.zeros((count + 1, labels), dtype=int)
    entry = np.full((count + 1, labels), np.inf)
    entry[0] = 0.0
    every = np.arange(labels)
    for stop in range(1, count + 1):
        stay = best[stop - 1] + cost[stop - 1]
        begun = stop - shortest
        allowed = begun >= 0
        begun = np.maximum(begun, 0)
        fresh = np.where(allowed, entry[begun, every] + total[stop] - total[begun, every], np.inf)
        best[stop] = np.minimum(stay, fresh)
        start[stop] = np.where(fresh < stay, begun, start[stop - 1])
        entry[stop] = cut_price + _least_of_others(best[stop])
    return _walk_back(best, start)


def _least_of_others(values: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
    """For each entry the minimum of all others."""
    first, second = np.partition(values, 1)[:2]
    others = np.full_like(values, first)
    others[np.argmin(values)] = second
    return others


def _walk_back(best: np.ndarray, start: np.ndarray) -> list[tuple[int, int, int]]:
    stretches: list[tuple[int, int, int]] = []
    stop, label = len(best) - 1, int(np.argmin(best[-1]))
    while True:
        begun = int(start[stop, label])
        stretches.append((begun, stop, label))
        if begun == 0:
            return stretches[::-1]
        values = best[begun].copy()
        values[label] = np.inf
        stop, label = begun, int(np.argmin(values))
