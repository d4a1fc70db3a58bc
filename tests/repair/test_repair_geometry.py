"""Geometry of repairs against what it must give: cubics, turned windows, and feet of known velocities."""

import numpy as np
import pytest

from pipeline import rotation
from pipeline.repair.contacts import FootPoints
from pipeline.repair.fill import _onto
from pipeline.repair.skating import planted
from pipeline.repair.unsteadiness import interpolation_miss
from tests.factories.human_clips import walker


@pytest.mark.parametrize("gap", [1, 2, 3, 4])
def test_a_cubic_misses_nothing_and_a_spike_its_size(gap: int):
    frames = np.linspace(-1.0, 1.0, 30)
    cubic = np.stack([frames**3 - 0.5 * frames**2, 2.0 * frames, np.ones(30)], axis=1)[:, None]
    inner = slice(6, -6)
    miss = interpolation_miss(cubic, gap)
    step = 2.0 / 29.0  # of an even gap the mean of the two middle frames stands for the value between them
    between = 0.0 if gap % 2 else 0.5 * (step / 2.0) ** 2 * (6.0 * 1.0 + 1.0)
    assert np.abs(miss[inner]).max() <= between + 1e-12
    spiked = cubic.copy()
    first = 15 - (gap - 1) // 2
    spiked[first : first + gap, 0, 1] += 0.3
    found = interpolation_miss(spiked, gap) - miss
    np.testing.assert_allclose(found[15, 0], [0.0, 0.3, 0.0], atol=1e-12)


@pytest.mark.parametrize("yaw", [0.9, -2.3])
def test_a_window_that_was_turned_and_moved_is_brought_back(yaw: float):
    clip = walker(seconds=1.0)
    turn = rotation.about_z(yaw)
    target = rotation.rotate(turn, clip.body_pos_w) + np.array([2.0, -3.0, 0.0])
    known = np.random.default_rng(0).uniform(size=clip.body_pos_w.shape[:2]) < 0.7
    pos, quat = _onto(clip.body_pos_w, clip.body_quat_w, np.where(known[..., None], target, 0.0), known)
    np.testing.assert_allclose(pos, target, atol=1e-9)
    assert rotation.angle_between(quat, rotation.multiply(turn, clip.body_quat_w)).max() < 1e-6


@pytest.mark.parametrize("slower", [0, 1])
def test_a_foot_is_planted_at_the_point_that_slides_less(slower: int):
    """A heel that rises moves on while the ball stands: the body goes back by the way of the ball alone."""
    clip = walker(seconds=2.0)
    count = clip.frame_count
    along = np.zeros((count, 2, 2))
    along[:, slower], along[:, 1 - slower] = [0.06, -0.08], [0.9, 0.4]
    foot = FootPoints(height=np.zeros((count, 2)), speed=np.linalg.norm(along, axis=-1), along_ground=along)
    found = planted(clip, (foot, foot), np.ones((count, 2), dtype=bool), slice(0, count), 0.5)
    way = found.clip.body_pos_w - clip.body_pos_w
    time_s = np.arange(count) / clip.fps
    expected = -time_s[:, None] * np.array([0.06, -0.08, 0.0])
    np.testing.assert_allclose(way, np.broadcast_to(expected[:, None], way.shape), atol=1e-9)
    assert found.mean_m_s == pytest.approx(0.1)
    assert found.way_m == pytest.approx(0.1 * time_s[-1])
