"""The segmentation against a search through all segmentations."""

import itertools

import numpy as np
import pytest

from pipeline.selection.skills import segment


def cost_of(stretches, cost, cut_price):
    inside = sum(cost[start:stop, label].sum() for start, stop, label in stretches)
    return inside + cut_price * (len(stretches) - 1)


def every_segmentation(count, labels, shortest):
    """All ways to tile `count` frames by stretches of allowed lengths, neighbours of different labels."""
    for cuts in itertools.product([False, True], repeat=count - 1):
        edges = [0, *[index + 1 for index, cut in enumerate(cuts) if cut], count]
        spans = list(itertools.pairwise(edges))
        for chosen in itertools.product(range(labels), repeat=len(spans)):
            long_enough = all(b - a >= shortest[k] for (a, b), k in zip(spans, chosen, strict=True))
            if long_enough and all(one != two for one, two in itertools.pairwise(chosen)):
                yield [(a, b, k) for (a, b), k in zip(spans, chosen, strict=True)]


@pytest.mark.parametrize("seed", range(12))
def test_no_segmentation_is_cheaper(seed):
    rng = np.random.default_rng(seed)
    cost, shortest = rng.random((9, 3)), np.array([3, 2, 2])
    cut_price = float(rng.uniform(0.0, 1.0))
    found = segment(cost, shortest, cut_price)
    best = min(cost_of(each, cost, cut_price) for each in every_segmentation(9, 3, shortest))
    assert cost_of(found, cost, cut_price) == pytest.approx(best, abs=1e-12)
    assert all(stop - start >= shortest[label] for start, stop, label in found)
    assert [found[0][0], *[stop for _, stop, _ in found]] == [*[start for start, _, _ in found], 9]


def test_a_clip_shorter_than_every_least_length_is_one_stretch():
    assert segment(np.array([[1.0, 0.2], [0.0, 0.1]]), np.array([3, 4]), 0.1) == [(0, 2, 1)]


def test_a_short_excursion_is_not_cut_out():
    cost = np.zeros((20, 2))
    cost[:, 1] = 1.0
    cost[8:11] = [1.0, 0.0]
    assert segment(cost, np.array([5, 5]), 0.5) == [(0, 20, 0)]
