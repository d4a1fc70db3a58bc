"""Velocity error and acceleration ratio of the pelvis, against sines whose derivatives are known."""

import dataclasses

import numpy as np
import pytest

from pipeline.scoring import score, score_without_collisions
from pipeline.scoring.align import _median
from tests.factories.retarget_clips import person_of
from tests.scoring.test_score import FPS, ROBOT, TOE, still

FRAMES = 300
TIMES_S = np.arange(FRAMES) / FPS


def moved(way_m: np.ndarray, axis: int = 0):
    """The robot at rest, its root moved along an axis."""
    clip = still(FRAMES)
    root_pos_w = clip.root_pos_w.copy()
    root_pos_w[:, axis] += way_m
    return dataclasses.replace(clip, root_pos_w=root_pos_w)


def test_a_root_that_sways_has_the_rms_velocity_of_its_sine():
    amplitude, hz = 0.05, 1.0
    figures = score(person_of(still(FRAMES), ROBOT, TOE), moved(amplitude * np.sin(2 * np.pi * hz * TIMES_S)), ROBOT)
    expected = amplitude * 2 * np.pi * hz / np.sqrt(2.0)
    assert figures.figures()["pelvis_velocity_error_m_s"] == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("scale", [0.95, 1.05])
def test_a_path_scaled_by_a_few_per_cent_is_no_error(scale):
    human = person_of(moved(1.2 * TIMES_S), ROBOT, TOE)
    figures = score(human, moved(scale * 1.2 * TIMES_S), ROBOT).figures()
    assert figures["pelvis_velocity_error_m_s"] == pytest.approx(0.0, abs=1e-6)


def test_a_path_at_half_the_speed_is_an_error():
    human = person_of(moved(1.2 * TIMES_S), ROBOT, TOE)
    figures = score(human, moved(0.6 * TIMES_S), ROBOT).figures()
    assert figures["pelvis_velocity_error_m_s"] == pytest.approx(0.9 * 1.2 - 0.6, rel=0.01)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_acceleration_ratio_is_that_of_the_amplitudes(axis):
    sine = np.sin(2 * np.pi * 1.0 * TIMES_S)
    human = person_of(moved(0.2 * sine, axis), ROBOT, TOE)
    samples = score_without_collisions(human, moved(0.4 * sine, axis), ROBOT).figures()
    ratio = samples["pelvis_acceleration_ratio"] * (1.0 if axis == 2 else 1.1)  # horizontally the scale fits, up to 1.1
    assert ratio == pytest.approx(2.0, rel=0.02)


def test_a_robot_at_rest_beside_a_person_at_rest_has_no_ratio_of_noise():
    noise = np.random.default_rng(1).normal(size=FRAMES) * 1e-4
    figures = score_without_collisions(person_of(still(FRAMES), ROBOT, TOE), moved(noise), ROBOT).figures()
    assert figures["pelvis_acceleration_ratio"] < 0.2


def test_the_median_of_labels_does_not_extend_a_stance_over_the_clips_end():
    label = np.array([False, False, True, True, True, True, False, False])
    np.testing.assert_array_equal(_median(label, 4), label & (np.arange(8) > 1))
    assert not _median(label, 4)[[0, 1, 6, 7]].any()
