"""Slip, heights and contact of soles whose motion is known, and their invariance."""

import dataclasses

import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.quality.sole import (
    ContactSettings,
    SoleMotion,
    contact_from_sole,
    inner_contacts,
    lowest_corner_slip,
    sole_motion,
)
from pipeline.robot import Robot
from tests.factories.robot_clips import standing, wandering

CONTACT = ContactSettings(height=0.01, on_speed=0.4, off_speed=0.7, shortest_s=0.04)
CORNERS = np.array([[0.1, 0.05, 0.0], [0.1, -0.05, 0.0], [-0.1, -0.05, 0.0], [-0.1, 0.05, 0.0]])


def _soles(left_w: np.ndarray, right_w: np.ndarray, fps: float = 50.0) -> SoleMotion:
    """Flat soles whose centres follow two paths (t, 3)."""
    corners = np.stack([left_w, right_w], axis=1)[:, :, None] + CORNERS
    return SoleMotion(fps=fps, corner_pos_w=corners, corner_vel_w=np.gradient(corners, 1.0 / fps, axis=0))


def test_a_foot_that_slides_at_a_speed_slips_at_that_speed():
    times_s = np.arange(100) / 50.0
    sliding = np.stack([0.12 * times_s, 0.16 * times_s, 0.0 * times_s], axis=1)
    soles = _soles(sliding, np.zeros((100, 3)))
    left = np.tile([True, False], (100, 1))
    assert lowest_corner_slip(soles, left)[0] == pytest.approx(0.2)
    assert lowest_corner_slip(soles, left)[1] == pytest.approx(0.2)
    assert lowest_corner_slip(soles, ~left)[0] == 0.0
    assert lowest_corner_slip(soles, np.zeros((100, 2), dtype=bool))[0] == 0.0


def test_a_foot_that_tips_about_its_front_edge_does_not_slip():
    angle = np.linspace(0.0, 0.5, 50)
    front = np.array([0.1, 0.0, 0.0])
    turned = (
        rotation.rotate(rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), angle)[:, None], CORNERS - front) + front
    )
    corners = np.stack([turned, turned], axis=1)
    soles = SoleMotion(fps=50.0, corner_pos_w=corners, corner_vel_w=np.gradient(corners, 0.02, axis=0))
    contacts = np.ones((50, 2), dtype=bool)
    assert lowest_corner_slip(soles, contacts)[0] == pytest.approx(0.0, abs=1e-9)
    assert soles.mean_speed[10:-10].min() > 0.04


def test_the_ends_of_a_contact_are_left_out():
    contacts = np.array([[True, False], [True, True], [True, True], [False, True], [False, False]])
    np.testing.assert_array_equal(
        inner_contacts(contacts), [[True, False], [True, False], [False, True], [False, False], [False, False]]
    )


def test_contact_is_told_from_height_and_speed_with_hysteresis():
    height = np.zeros(60)
    height[20:30] = 0.05
    speed = np.full(60, 0.1)
    speed[40:50] = 0.6  # above the speed it begins at, below the one it ends at
    path = np.stack([np.cumsum(speed) / 50.0, 0.0 * height, height], axis=1)
    found = contact_from_sole(_soles(path, path + np.array([0.0, 0.2, 0.5])), CONTACT)
    assert found[5:18, 0].all()
    assert not found[21:29, 0].any()
    assert found[33:, 0].all()
    assert not found[:, 1].any()


def test_a_gap_of_one_frame_is_closed_and_a_touch_of_one_frame_dropped():
    height = np.zeros(40)
    height[10] = 0.02
    flying = np.full(40, 0.1)
    flying[20] = 0.0
    still = np.zeros(40)
    contact = contact_from_sole(
        SoleMotion(
            fps=50.0,
            corner_pos_w=np.stack([still, still, height], axis=1)[:, None, None] * np.ones((1, 2, 4, 1)),
            corner_vel_w=np.zeros((40, 2, 4, 3)),
        ),
        CONTACT,
    )
    assert contact.all()
    dropped = contact_from_sole(
        SoleMotion(
            fps=50.0,
            corner_pos_w=np.stack([still, still, flying], axis=1)[:, None, None] * np.ones((1, 2, 4, 1)),
            corner_vel_w=np.zeros((40, 2, 4, 3)),
        ),
        CONTACT,
    )
    assert not dropped.any()


def test_the_soles_of_the_default_pose_are_on_the_ground(robot: Robot):
    soles = sole_motion(standing(robot), robot)
    np.testing.assert_allclose(soles.height, 0.0, atol=2e-3)
    np.testing.assert_allclose(soles.lowest_corner_speed, 0.0, atol=1e-9)
    width = np.linalg.norm(soles.corner_pos_w[0, 0, 0] - soles.corner_pos_w[0, 0, 1])
    assert width == pytest.approx(0.1, abs=1e-6)  # the foot box of the published model


def test_metrics_do_not_change_under_heading_and_place(robot: Robot):
    clip = wandering(robot)
    assert clip.contacts is not None
    turn = rotation.about_z(1.3)
    moved: RobotClip = dataclasses.replace(
        clip,
        root_pos_w=rotation.rotate(turn, clip.root_pos_w) + np.array([3.0, -7.0, 0.0]),
        root_quat_w=rotation.multiply(turn, clip.root_quat_w),
    )
    here, there = sole_motion(clip, robot), sole_motion(moved, robot)
    np.testing.assert_allclose(there.height, here.height, atol=1e-9)
    slip_here, slip_there = lowest_corner_slip(here, clip.contacts), lowest_corner_slip(there, clip.contacts)
    assert slip_here[0] > 0.05
    assert slip_there == pytest.approx(slip_here)
