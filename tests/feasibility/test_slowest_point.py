"""A foot slides as fast as the point of its sole that slides least."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import nnls

from pipeline.feasibility import FeasibilitySettings
from pipeline.feasibility.assess import parted
from pipeline.feasibility.foot_criteria import foot_slip
from pipeline.feasibility.motion import Motion, motion_of
from pipeline.feasibility.slowest_point import distance_from_zero, slowest_point_speed
from pipeline.quality.sole import SoleMotion, contact_from_sole
from pipeline.robot import Robot
from tests.factories.robot_clips import standing

FRAMES, LEVEL = 100, 0.01
CORNERS = np.array([[0.12, 0.05, 0.0], [0.12, -0.05, 0.0], [-0.1, -0.05, 0.0], [-0.1, 0.05, 0.0]])
"""Of a sole about its ankle [m]."""


def _foot(velocity: tuple[float, float] = (0.0, 0.0), turning: float = 0.0, pivot: tuple[float, float] = (0.0, 0.0)):
    """Corners and their velocities (t, 4, 3) of a flat foot that turns about a point [rad/s] and moves [m/s]."""
    arms = CORNERS - np.array([*pivot, 0.0])
    turned = turning * np.stack([-arms[:, 1], arms[:, 0], np.zeros(4)], axis=1)
    moved = turned + np.array([*velocity, 0.0])
    return np.broadcast_to(CORNERS, (FRAMES, 4, 3)), np.broadcast_to(moved, (FRAMES, 4, 3))


def _soles(*feet) -> SoleMotion:
    pos, vel = (np.stack([foot[which] for foot in feet], axis=1) for which in range(2))
    return SoleMotion(fps=50.0, corner_pos_w=pos, corner_vel_w=vel)


def test_a_foot_that_turns_on_the_spot_stands_and_its_corners_do_not():
    soles = _soles(_foot(turning=4.0), _foot(turning=4.0, pivot=(0.03, -0.02)))
    np.testing.assert_allclose(slowest_point_speed(soles, LEVEL), 0.0, atol=1e-12)
    assert np.all(soles.lowest_corner_speed > 0.4)


def test_a_foot_that_turns_about_a_point_beside_it_slides_as_its_nearest_point_does():
    soles = _soles(_foot(turning=2.0, pivot=(0.32, 0.0)), _foot(turning=2.0, pivot=(0.12 + 0.3, 0.05 + 0.4)))
    np.testing.assert_allclose(slowest_point_speed(soles, LEVEL), [[2.0 * 0.2, 2.0 * 0.5]] * FRAMES)


def test_a_foot_that_slides_along_slides_at_its_speed():
    soles = _soles(_foot((0.3, -0.4)), _foot((0.3, 0.0), turning=0.5))
    slip = slowest_point_speed(soles, LEVEL)
    np.testing.assert_allclose(slip[:, 0], 0.5)
    assert np.all(slip[:, 1] == pytest.approx(0.3 - 0.5 * 0.05))


def test_only_the_part_of_the_sole_that_is_on_the_ground_may_stand():
    pos, vel = _foot(turning=4.0)
    raised = pos + np.array([0.0, 0.0, 1.0]) * np.array([0.0, 0.0, 0.03, 0.03])[:, None]  # on its toes
    slip = slowest_point_speed(_soles((raised, vel), (pos, vel)), LEVEL)
    np.testing.assert_allclose(slip, [[4.0 * 0.12, 0.0]] * FRAMES, atol=1e-12)


def test_the_distance_of_a_polygon_from_zero_is_that_of_its_nearest_mixture():
    rng = np.random.default_rng(3)
    points = rng.normal(size=(300, 4, 2)) + rng.normal(scale=1.5, size=(300, 1, 2))
    taken = rng.random((300, 4)) < 0.8
    taken[:, 0] = True
    wanted = []
    for each, on in zip(points, taken, strict=True):  # weights >= 0 that sum to one, by a heavy row
        corners = each[on]
        matrix = np.vstack([corners.T, np.full(len(corners), 1e4)])
        weights = nnls(matrix, np.array([0.0, 0.0, 1e4]))[0]
        wanted.append(np.linalg.norm(weights @ corners / weights.sum()))
    np.testing.assert_allclose(distance_from_zero(points, taken), wanted, atol=1e-5)


def _motion(robot: Robot, limits: FeasibilitySettings, soles: SoleMotion, labels: np.ndarray | None) -> Motion:
    """A standing robot with other soles."""
    motion = motion_of(standing(robot), robot, limits)
    contacts = contact_from_sole(soles, limits.contact) if labels is None else labels
    return dataclasses.replace(motion, sole=soles, contacts=contacts, labelled=labels is not None)


BOTH = np.ones((FRAMES, 2), dtype=bool)


def test_a_robot_that_turns_on_flat_feet_does_not_slip(robot: Robot, limits: FeasibilitySettings):
    soles = _soles(_foot(turning=3.0), _foot(turning=3.0))
    for labels in (BOTH, None):
        for verdict in parted(foot_slip(_motion(robot, limits, soles, labels), limits.feet))[0]:
            assert verdict.holds
            assert verdict.value == pytest.approx(0.0, abs=1e-9)


def test_without_labels_a_foot_that_moves_low_while_the_other_stands_is_on_its_way(
    robot: Robot, limits: FeasibilitySettings
):
    soles = _soles(_foot((0.35, 0.0)), _foot())
    told = _motion(robot, limits, soles, None)
    assert told.contacts.all()
    assert all(verdict.holds for verdict in foot_slip(told, limits.feet))
    holds = {verdict.code: verdict.holds for verdict in foot_slip(_motion(robot, limits, soles, BOTH), limits.feet)}
    assert holds == {"foot_slip_mean": False, "foot_slip_p95": False, "foot_inferred_slip_mean": True}


def test_without_labels_two_feet_that_slide_are_told(robot: Robot, limits: FeasibilitySettings):
    _, mean, p95 = foot_slip(_motion(robot, limits, _soles(_foot((0.35, 0.0)), _foot((0.0, 0.3))), None), limits.feet)
    assert mean.value == pytest.approx(0.3)
    assert p95.value == pytest.approx(0.3)
    assert not mean.holds
    assert mean.bad is not None
    assert mean.bad.sum() >= FRAMES - 2
