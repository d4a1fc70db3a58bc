"""Command velocity and smoothness of motions with a formula."""

import numpy as np
import pytest

from pipeline import rotation, time_series
from pipeline.quality.planar_motion import command_velocity
from pipeline.quality.retargeting import acceleration_p99, mean_jerk, percentile


@pytest.mark.parametrize("start", [0.0, 2.0, -3.0])
def test_walking_on_a_circle_is_forward_and_turning(start: float):
    times_s = np.arange(0.0, 8.0, 0.02)
    yaw = start + 1.0 * times_s  # turns past pi
    radius = 0.8
    root = np.stack([radius * np.sin(yaw), -radius * np.cos(yaw), 0.7 + 0.0 * yaw], axis=1)
    found = command_velocity(root, rotation.about_z(yaw), 50.0)
    assert found.forward_m_s == pytest.approx(0.8, abs=1e-3)
    assert found.lateral_m_s == pytest.approx(0.0, abs=1e-3)
    assert found.yaw_rate_rad_s == pytest.approx(1.0, abs=1e-9)


def test_sideways_is_to_the_left_of_the_heading_also_when_leaning():
    times_s = np.arange(0.0, 2.0, 0.02)
    yaw = rotation.about_z(0.7 + 0.0 * times_s)
    lean = rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), 0.3 + 0.0 * times_s)
    left_w = np.array([-np.sin(0.7), np.cos(0.7), 0.0])
    found = command_velocity(0.4 * times_s[:, None] * left_w, rotation.multiply(yaw, lean), 50.0)
    assert found.lateral_m_s == pytest.approx(0.4)
    assert found.forward_m_s == pytest.approx(0.0, abs=1e-9)
    assert found.yaw_rate_rad_s == pytest.approx(0.0, abs=1e-9)


def test_jerk_and_acceleration_of_a_sine():
    times_s = np.arange(0.0, 20.0, 0.02)
    omega, size = 4.0, 0.1
    bounce = np.stack([0.0 * times_s, 0.0 * times_s, size * np.sin(omega * times_s)], axis=1)
    smooth = time_series.smooth(bounce, 50.0, 20.0)
    assert mean_jerk(smooth, 50.0) == pytest.approx(size * omega**3 * 2.0 / np.pi, rel=0.04)
    assert acceleration_p99(smooth[:, 2:], 50.0) == pytest.approx(size * omega**2, rel=0.02)


def test_what_is_too_short_is_smooth():
    assert mean_jerk(np.zeros((3, 3)), 50.0) == 0.0
    assert acceleration_p99(np.zeros((2, 4)), 50.0) == 0.0
    assert command_velocity(np.zeros((1, 3)), rotation.about_z(np.zeros(1)), 50.0).forward_m_s == 0.0


@pytest.mark.parametrize("count", [1, 2, 25, 100, 2_300])
@pytest.mark.parametrize("percent", [0, 5, 50, 95, 99, 100])
def test_a_percentile_has_the_bits_of_numpys(count: int, percent: float):
    for values in np.random.default_rng(count).normal(size=(20, count)) * [[10.0**power] for power in range(-10, 10)]:
        assert percentile(values, percent) == np.percentile(values, percent)
