"""Derivatives, resampling and smoothing against functions whose answer is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from pipeline import rotation, time_series


def test_derivative_of_a_parabola_is_exact_inside():
    times_s = time_series.frame_times(50, 25.0)
    velocity = time_series.derivative(3.0 * times_s[:, None] ** 2, 25.0)
    np.testing.assert_allclose(velocity[1:-1, 0], 6.0 * times_s[1:-1], atol=1e-10)


def test_one_frame_stands_still():
    assert np.all(time_series.derivative(np.ones((1, 3)), 50.0) == 0.0)


@given(
    st.integers(2, 400), st.sampled_from([24.0, 25.0, 30.0, 59.94, 60.0, 100.0, 120.0]), st.sampled_from([30.0, 50.0])
)
def test_resampling_keeps_a_straight_line_and_the_last_frame_that_fits(frames, fps, new_fps):
    times_s = time_series.resample_times(frames, fps, new_fps)
    duration_s = (frames - 1) / fps
    assert times_s[-1] <= duration_s + 1e-6 < times_s[-1] + 1.0 / new_fps + 1e-6
    line = 2.0 * time_series.frame_times(frames, fps)[:, None]
    np.testing.assert_allclose(time_series.resample_linear(line, fps, times_s)[:, 0], 2.0 * times_s, atol=1e-6)


def test_resampled_quaternions_lie_on_the_arc():
    quat = rotation.about_z(0.3 * np.arange(31))[:, None]
    times_s = time_series.resample_times(31, 30.0, 50.0)
    found = time_series.resample_quat(quat, 30.0, times_s)[:, 0]
    np.testing.assert_allclose(rotation.wrap(rotation.yaw_of(found) - 9.0 * times_s), 0.0, atol=1e-9)


@pytest.mark.parametrize("fps", [60.0, 120.0])
def test_smoothing_halves_the_power_at_the_cutoff_and_has_no_lag(fps):
    times_s = time_series.frame_times(int(8 * fps), fps)
    wave = np.sin(2.0 * np.pi * 6.0 * times_s)
    found = time_series.smooth(wave, fps, 6.0)
    inner = slice(int(2 * fps), int(6 * fps))
    gain = np.dot(found[inner], wave[inner]) / np.dot(wave[inner], wave[inner])
    assert gain == pytest.approx(1.0 / np.sqrt(2.0), abs=0.01)
    quadrature = np.cos(2.0 * np.pi * 6.0 * times_s)
    assert abs(np.dot(found[inner], quadrature[inner])) / np.dot(wave[inner], wave[inner]) < 1e-3


def test_a_cutoff_above_what_the_rate_can_hold_changes_nothing():
    values = np.random.default_rng(0).normal(size=100)
    assert np.array_equal(time_series.smooth(values, 30.0, 14.0), values)


def test_moving_mean_of_a_line_is_the_line_and_ends_shrink():
    line = np.arange(20.0)
    found = time_series.moving_mean(line, 5)
    np.testing.assert_allclose(found[2:-2], line[2:-2])
    assert found[0] == pytest.approx(1.0)


@given(st.lists(st.booleans(), max_size=60))
def test_runs_mark_exactly_the_frames_that_hold(flags):
    mask = np.zeros(len(flags), dtype=bool)
    for start, stop in time_series.runs(np.array(flags, dtype=bool)):
        assert start < stop
        mask[start:stop] = True
    assert mask.tolist() == flags


@pytest.mark.parametrize("shape", [(2,), (3, 2), (60, 3), (200, 4, 3)])
def test_a_derivative_has_the_bits_of_numpys_gradient(shape):
    values = np.random.default_rng(0).normal(size=shape)
    np.testing.assert_array_equal(time_series.derivative(values, 50.0), np.gradient(values, 1.0 / 50.0, axis=0))


@pytest.mark.parametrize("frames", [7, 15, 16, 40, 300])
def test_smoothing_has_the_bits_of_scipys_filter_forward_and_back(frames):
    values = np.random.default_rng(0).normal(size=(frames, 2, 3)).cumsum(axis=0)
    raised = 50.0 / np.pi * np.arctan(np.tan(np.pi * 10.0 / 50.0) / (np.sqrt(2.0) - 1.0) ** 0.25)
    sections = signal.butter(2, raised, fs=50.0, output="sos")
    wanted = signal.sosfiltfilt(sections, values, axis=0, padtype="odd", padlen=min(15, frames - 1))
    np.testing.assert_array_equal(time_series.smooth(values, 50.0, 10.0), wanted)
