"""Cutting and resampling are the same for human and robot clips: every array, by what it holds."""

import dataclasses

import numpy as np
import pytest

from tests.factories.robot_clips import standing
from tests.factories.simulated_clip import simulated_standing


def test_a_cut_takes_the_same_frames_of_every_array_and_copies_them(robot):
    clip = simulated_standing(robot, 0.5)
    cut = clip.cut(5, 15, "part")
    assert (cut.name, cut.frame_count, cut.duration_s) == ("part", 10, 10 / clip.fps)
    for name in ("root_pos_w", "root_quat_w", "joint_pos", "contacts"):
        np.testing.assert_array_equal(getattr(cut, name), getattr(clip, name)[5:15])
        assert not np.shares_memory(getattr(cut, name), getattr(clip, name))
    assert clip.forces is not None and cut.forces is not None
    np.testing.assert_array_equal(cut.forces.joint_torque, clip.forces.joint_torque[5:15])


def test_resampling_keeps_labels_boolean_rotations_unit_and_drops_forces(robot):
    clip = standing(robot)
    half = np.arange(clip.frame_count)[:, None] % 2 == [0, 1]
    clip = dataclasses.replace(clip, contacts=half, root_pos_w=clip.root_pos_w + np.arange(clip.frame_count)[:, None])
    other = clip.resampled(30.0)
    assert other.fps == 30.0
    assert other.duration_s == pytest.approx(clip.duration_s, abs=1.0 / 30.0)
    assert other.contacts is not None and other.contacts.dtype == bool
    np.testing.assert_allclose(np.linalg.norm(other.root_quat_w, axis=1), 1.0)
    np.testing.assert_allclose(np.diff(other.root_pos_w, axis=0), 50.0 / 30.0)
    assert clip.resampled(clip.fps) is clip
    assert simulated_standing(robot, 0.5).resampled(25.0).forces is None
