"""Criteria of the root on a sway whose derivatives are known."""

import dataclasses

import numpy as np
import pytest

from pipeline import rotation
from pipeline.feasibility import FeasibilitySettings
from pipeline.feasibility.motion import motion_of
from pipeline.feasibility.root_criteria import root_jerk, root_speeds
from pipeline.robot import Robot
from tests.factories.robot_clips import standing


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_sway_has_the_derivatives_of_its_sine(robot: Robot, limits: FeasibilitySettings, axis: int):
    """A sin(wt) along an axis, B sin(wt) about the one before it: the largest speeds are A w and B w, the acceleration
    A w², the mean size of the jerk 2 A w³ / pi."""
    clip, omega = standing(robot, 8.0), 2.0 * np.pi * 0.5
    wave = np.sin(omega * np.arange(clip.frame_count) / clip.fps)
    turn = rotation.from_axis_angle(np.eye(3)[axis - 1], 0.2 * wave)
    swaying = dataclasses.replace(
        clip,
        root_pos_w=clip.root_pos_w + 0.1 * wave[:, None] * np.eye(3)[axis],
        root_quat_w=rotation.multiply(turn, clip.root_quat_w),
    )
    motion = motion_of(swaying, robot, limits)
    found = [each.value for each in (*root_speeds(motion, limits.root), *root_jerk(motion, limits.root))]
    wanted = [0.1 * omega, 0.2 * omega, 0.1 * omega**2, 2.0 * 0.1 * omega**3 / np.pi]
    assert found == pytest.approx(wanted, rel=0.05)
