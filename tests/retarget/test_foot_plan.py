"""The foot plan: stances locked, swings joined without a step, soles over the ground."""

import numpy as np
import pytest

from pipeline.retarget import foot_plan, foot_spacing
from pipeline.retarget.foot_plan import PITCH, YAW, Sole
from pipeline.retarget.settings import FootSettings

SOLE = Sole(depth=0.05, front=0.12, rear=-0.1, half_width=0.05)
FEET = FootSettings(
    ball_share=1.0,
    heel_rise_share=1.0,
    heel_strike_share=1.0,
    heel_rise_free=0.0,
    highest_pitch=0.9,
    lowest_pitch=-0.4,
    slope_s=0.2,
    clearance=0.01,
    spacing=0.02,
    reach_free=0.1,
    wary=0.03,
    spacing_s=0.06,
)


def corner_heights(foot: np.ndarray) -> np.ndarray:
    """Front and rear edge of a pitched sole, by rotating them."""
    edges = np.array([[SOLE.front, -SOLE.depth], [SOLE.rear, -SOLE.depth]])
    sine, cosine = np.sin(foot[:, PITCH]), np.cos(foot[:, PITCH])
    return foot[:, 2, None] - sine[:, None] * edges[:, 0] + cosine[:, None] * edges[:, 1]


def test_the_lowest_ankle_puts_the_lowest_edge_on_the_ground():
    pitch = np.linspace(-0.6, 1.0, 50)
    foot = np.zeros((50, 5))
    foot[:, 2], foot[:, PITCH] = SOLE.lowest_ankle(pitch), pitch
    np.testing.assert_allclose(corner_heights(foot).min(axis=1), 0.0, atol=1e-12)


def test_a_stance_keeps_the_ball_of_the_foot_still_while_the_heel_rises():
    raw = np.zeros((40, 5))
    raw[:, PITCH] = np.linspace(0.0, 0.7, 40)
    toe_w = np.tile([1.0, 2.0], (40, 1))
    locked = foot_plan.lock_stances(raw, np.ones(40, dtype=bool), toe_w, np.full(40, 0.5), 0.08, SOLE, FEET)
    sine, cosine = np.sin(locked[:, PITCH]), np.cos(locked[:, PITCH])
    along = SOLE.front * cosine - SOLE.depth * sine
    front = locked[:, :2] + along[:, None] * [np.cos(0.5), np.sin(0.5)]
    np.testing.assert_allclose(front, np.tile(front[0], (40, 1)), atol=1e-12)
    np.testing.assert_allclose(locked[:, YAW], 0.5)
    assert np.ptp(locked[:, PITCH]) > 0.5


def test_the_flat_ankle_stands_where_the_humans_does():
    raw = np.zeros((5, 5))
    toe_w = np.tile([0.08, 0.0], (5, 1))
    locked = foot_plan.lock_stances(raw, np.ones(5, dtype=bool), toe_w, np.zeros(5), 0.08, SOLE, FEET)
    np.testing.assert_allclose(locked[:, :2], 0.0, atol=1e-12)


@pytest.mark.parametrize("near", [3.1, -3.1, 9.4])
def test_a_stance_that_points_backward_has_the_yaw_of_its_angles_on_either_branch(near: float):
    raw = np.zeros((6, 5))
    raw[:, YAW] = near
    toe_yaw = np.array([3.13, -3.13, 3.1, -3.14, 3.12, -3.12])  # pi give or take 0.04
    contact = np.ones(6, dtype=bool)
    locked = foot_plan.lock_stances(raw, contact, np.zeros((6, 2)), toe_yaw, 0.08, SOLE, FEET)
    assert np.ptp(locked[:, YAW]) == 0.0
    assert np.cos(locked[0, YAW]) < -0.999
    assert abs(locked[0, YAW] - near) < 0.1


@pytest.mark.parametrize("speed", [0.0, 0.01])
def test_a_swing_joins_its_stances_without_a_step_in_position_or_speed(speed):
    frames = np.arange(60)
    raw = np.zeros((60, 5))
    raw[:, 0] = 0.02 * frames + speed * frames
    contact = (frames < 20) | (frames >= 40)
    locked = raw.copy()
    locked[:20, 0], locked[40:, 0] = 0.3, 0.9
    plan = foot_plan.spread(raw, locked, contact, 10)
    np.testing.assert_array_equal(plan[contact], locked[contact])
    np.testing.assert_allclose(np.diff(plan[18:21, 0]), 0.0, atol=0.006)
    np.testing.assert_allclose(np.diff(plan[39:41, 0]), 0.0, atol=0.006)
    assert np.abs(np.diff(plan[:, 0], n=2)).max() < 0.01, "the raw motion's own speed is 0.02 a frame"


def test_without_a_stance_the_raw_motion_stays():
    raw = np.random.default_rng(0).normal(size=(10, 5))
    np.testing.assert_array_equal(foot_plan.spread(raw, raw, np.zeros(10, dtype=bool), 3), raw)


def test_swings_are_lifted_over_the_ground():
    plan = np.zeros((30, 5))
    plan[:, PITCH] = np.linspace(-1.0, 1.5, 30)
    contact = np.zeros(30, dtype=bool)
    contact[[0, 29]] = True
    plan[contact, PITCH] = 0.0
    plan[contact, 2] = SOLE.depth
    lifted = foot_plan.keep_above_ground(plan, contact, SOLE, FEET)
    assert corner_heights(lifted).min() >= -1e-12
    assert corner_heights(lifted)[15].min() >= 0.009
    assert lifted[:, PITCH].max() <= FEET.highest_pitch
    assert lifted[:, PITCH].min() >= FEET.lowest_pitch


@pytest.mark.parametrize("percent", [0.0, 5.0, 30.0, 50.0, 77.7, 100.0])
@pytest.mark.parametrize("count", [1, 2, 9, 40])
def test_percentiles_are_numpys_to_the_bit(count, percent):
    values = np.random.default_rng(count).normal(size=(count, 2))
    np.testing.assert_array_equal(foot_plan.percentile(values, percent), np.percentile(values, percent, axis=0))


def feet_apart(lateral: float) -> np.ndarray:
    feet = np.zeros((2, 30, 5))
    feet[0, :, 1], feet[1, :, 1] = lateral / 2, -lateral / 2
    return feet


@pytest.mark.parametrize(("lateral", "lacking"), [(0.2, 0.0), (0.1, 0.03), (-0.05, 0.18)])
def test_parallel_feet_lack_what_their_discs_and_the_gap_need(lateral, lacking):
    got = foot_spacing.overlap(feet_apart(lateral), np.zeros(30), SOLE, 0.02)
    np.testing.assert_allclose(got, lacking, atol=1e-12)


def test_feet_one_behind_the_other_may_cross():
    feet = feet_apart(-0.05)
    feet[0, :, 0] += 0.4
    np.testing.assert_array_equal(foot_spacing.overlap(feet, np.zeros(30), SOLE, 0.02), 0.0)


def outline(foot: np.ndarray) -> np.ndarray:
    """Corners (4, 2) of a sole seen from above [m]."""
    x = np.array([SOLE.rear, SOLE.front, SOLE.front, SOLE.rear])
    y = SOLE.half_width * np.array([-1.0, -1.0, 1.0, 1.0])
    cosine, sine = np.cos(foot[YAW]), np.sin(foot[YAW])
    return np.column_stack([foot[0] + cosine * x - sine * y, foot[1] + sine * x + cosine * y])


def separated(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether a line along a side of one of two rectangles has them on different sides."""
    for corners in (a, b):
        for side in (corners[1] - corners[0], corners[2] - corners[1]):
            normal = np.array([-side[1], side[0]])
            along = [each @ normal for each in (a, b)]
            if along[0].min() > along[1].max() or along[1].min() > along[0].max():
                return True
    return False


def test_turned_soles_are_apart_after_the_way_that_corners_need_and_not_before():
    rng = np.random.default_rng(3)
    feet = np.zeros((2, 200, 5))
    for foot in feet:
        foot[:, :2] = rng.uniform(-0.15, 0.15, (200, 2))
        foot[:, YAW] = rng.uniform(-1.5, 1.5, 200)
    left, right = feet
    way = foot_spacing.corner_overlap(feet, np.zeros(200), SOLE, 0.0)
    assert 0.3 < (way > 0.0).mean() < 1.0
    for frame in range(200):
        moved = [outline(left[frame]) + np.array([0.0, way[frame] + extra]) for extra in (1e-6, -1e-3)]
        other = outline(right[frame])
        assert separated(moved[0], other) or way[frame] == 0.0
        assert way[frame] == 0.0 or not separated(moved[1], other)


def test_footholds_are_moved_apart_and_stay_constant():
    locked = feet_apart(0.05)
    contacts = np.ones((30, 2), dtype=bool)
    foot_spacing.space_footholds(locked, contacts, np.zeros(30), SOLE, 0.02, 2)
    assert foot_spacing.overlap(locked, np.zeros(30), SOLE, 0.02).max() < 1e-9
    assert all(np.ptp(foot[:, 1]) == 0.0 for foot in locked)


def test_a_swing_gives_way_and_the_standing_foot_stays():
    feet = feet_apart(0.2)
    left, right = feet
    left[:, 0] = np.linspace(-0.5, 0.5, 30)
    left[:, 1] = 0.1 - 0.08 * np.exp(-(left[:, 0] ** 2) / 0.05)
    contacts = np.zeros((30, 2), dtype=bool)
    contacts[[0, 29], 0] = contacts[:, 1] = True
    before, ends = right.copy(), left[[0, 29]].copy()
    foot_spacing.space_swings(feet, contacts, np.zeros(30), SOLE, 0.02, 2.0)
    np.testing.assert_array_equal(right, before)
    np.testing.assert_array_equal(left[[0, 29]], ends)
    assert foot_spacing.overlap(feet, np.zeros(30), SOLE, 0.02).max() < 0.005
