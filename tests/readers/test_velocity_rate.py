"""The rate that stored velocities show, against velocities of a motion known in closed form."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from pipeline.readers.velocity_rate import VelocityRate, rate_of_velocities, surest

FREQUENCIES_HZ = np.array([0.5, 1.0, 2.0, 3.2])
PHASES = np.arange(4.0)


def motion(fps, seconds=6.0):
    """Four joints that swing at 0.5 to 3.2 Hz, as legs and arms do: positions [rad] and exact velocities [rad/s]."""
    angle = 2.0 * np.pi * FREQUENCIES_HZ * np.arange(round(fps * seconds))[:, None] / fps + PHASES
    return 0.3 * np.sin(angle), 0.3 * 2.0 * np.pi * FREQUENCIES_HZ * np.cos(angle)


@pytest.mark.parametrize("fps", [30.0, 77.0, 80.0, 120.0, 500.0])
@pytest.mark.parametrize("kind", ["exact", "central", "forward", "smoothed", "noisy"])
def test_the_true_rate_is_never_contradicted_and_half_and_double_are(fps, kind):
    position, velocity = motion(fps)
    central = np.gradient(position, 1.0 / fps, axis=0)
    velocity = {
        "exact": velocity,
        "central": central,
        "forward": np.diff(position, axis=0, append=position[-1:]) * fps,
        "smoothed": gaussian_filter1d(central, 1.0, axis=0),
        "noisy": central + 0.1 * central.std() * np.random.default_rng(1).normal(size=central.shape),
    }[kind]
    found = rate_of_velocities(position, velocity)
    if found is None:
        assert (fps, kind) == (30.0, "forward")  # a frame is too long for them to agree
        return
    assert not found.contradicts(fps)
    assert found.contradicts(0.5 * fps) and found.contradicts(2.0 * fps)
    if kind == "central":
        assert found.fps == pytest.approx(fps) and found.misfit < 1e-6


def test_smoothed_velocities_look_like_another_usual_rate_and_do_not_correct_the_declared_one():
    position, _ = motion(30.0)
    found = rate_of_velocities(position, gaussian_filter1d(np.gradient(position, 1.0 / 30.0, axis=0), 1.0, axis=0))
    assert found is not None and found.usual_fps == 25.0 and not found.contradicts(30.0)


def test_the_rate_that_fits_better_is_taken():
    good, bad = VelocityRate(fps=80.0, misfit=0.01), VelocityRate(fps=50.0, misfit=0.1)
    assert surest(bad, None, good) is good
    assert surest(None, None) is None


@pytest.mark.parametrize("change", ["few frames", "nothing moves", "unrelated"])
def test_velocities_that_say_nothing_give_no_rate(change):
    position, velocity = motion(50.0)
    if change == "few frames":
        position, velocity = position[:9], velocity[:9]
    elif change == "nothing moves":
        position = np.zeros_like(position)
    else:
        velocity = np.random.default_rng(2).normal(size=velocity.shape)
    assert rate_of_velocities(position, velocity) is None
