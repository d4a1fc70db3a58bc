"""The measure that jumps are found by, against its definition with numpy's own median and norm."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline import rotation
from pipeline.repair.unsteadiness import MotionFeatures
from tests.factories.human_clips import walker


@pytest.fixture(scope="module")
def features() -> MotionFeatures:
    clip = walker(seconds=1.0)
    noise = np.random.default_rng(1).normal(scale=0.01, size=clip.body_pos_w.shape)
    return MotionFeatures(pos_w=clip.body_pos_w + noise, quat_w=clip.body_quat_w)


def test_a_step_is_held_against_the_median_of_five_and_the_mean_of_its_neighbours(features: MotionFeatures):
    steps = np.diff(features.pos_w, axis=0)
    for frame in range(2, len(steps) - 2):
        median = np.median(steps[frame - 2 : frame + 3], axis=0)
        mean = (steps[frame - 1] + steps[frame + 1]) / 2.0
        expected = np.minimum(*(np.linalg.norm(steps[frame] - other, axis=-1) for other in (median, mean)))
        assert np.array_equal(features.unsteadiness.world[frame + 1], expected)


def test_a_step_that_is_not_known_makes_its_neighbours_unknown():
    clip = walker(seconds=1.0)
    pos_w = clip.body_pos_w.copy()
    pos_w[12, 3] = np.nan
    measured = MotionFeatures(pos_w=pos_w, quat_w=clip.body_quat_w).unsteadiness.world
    assert np.isnan(measured[10:16, 3]).all()
    assert np.isfinite(np.delete(measured, 3, axis=1)).all()


def test_turns_are_the_angles_between_frames(features: MotionFeatures):
    angles = rotation.angle_between(features.quat_w[:-1], features.quat_w[1:])
    assert np.array_equal(rotation.length(features.world_turns), angles)


def test_length_has_the_bits_of_numpys_norm():
    vectors = np.random.default_rng(2).normal(size=(200, 7, 3))
    assert np.array_equal(rotation.length(vectors), np.linalg.norm(vectors, axis=-1))
