"""Frames that are stored several times."""

import dataclasses

import numpy as np
import pytest

from pipeline.catalog.catalogue import each_once, times_stored
from tests.factories.gliding import gliding_robot
from tests.factories.human_clips import standing, walker

SHARE = 0.95


def repeated(clip, times, drop=0):
    arrays = ("body_pos_w", "body_quat_w", "contacts") if hasattr(clip, "body_pos_w") else ("root_pos_w", "root_quat_w")
    arrays = (*arrays, "joint_pos") if hasattr(clip, "joint_pos") else arrays
    values = {name: np.repeat(getattr(clip, name), times, axis=0)[drop:] for name in arrays}
    return dataclasses.replace(clip, fps=clip.fps * times, **values)


@pytest.mark.parametrize("times", [2, 3, 4, 5])
@pytest.mark.parametrize("drop", [0, 1])
def test_every_stored_frame_comes_back_once(times, drop):
    clip = walker(seconds=3.0, fps=30.0)
    spoilt = repeated(clip, times, drop)
    found, first = times_stored(spoilt, SHARE)
    assert found == times
    once = each_once(spoilt, found, first)
    lost = 1 if drop else 0
    assert once.fps == 30.0
    np.testing.assert_array_equal(once.body_pos_w, clip.body_pos_w[lost:])
    np.testing.assert_array_equal(once.contacts, clip.contacts[lost:])


def test_a_robot_clip_stored_twice_is_found():
    clip = gliding_robot([(3.0, 0.5, 0.0, 0.0)])
    swinging = dataclasses.replace(clip, joint_pos=np.sin(np.arange(clip.frame_count))[:, None] * np.ones(2))
    assert times_stored(repeated(swinging, 2), SHARE) == (2, 0)
    assert times_stored(swinging, SHARE) == (1, 0)


def test_one_missing_frame_does_not_hide_the_pattern():
    spoilt = repeated(walker(seconds=3.0, fps=30.0), 2)
    pos = spoilt.body_pos_w.copy()
    pos[21] = np.nan
    assert times_stored(dataclasses.replace(spoilt, body_pos_w=pos), SHARE)[0] == 2


def test_sound_clips_are_left_alone():
    assert times_stored(walker(seconds=3.0), SHARE) == (1, 0)
    assert times_stored(standing(seconds=3.0), SHARE) == (1, 0)


def test_a_frozen_clip_and_a_frozen_tail_are_no_repetition():
    clip = walker(seconds=4.0)
    pos = clip.body_pos_w.copy()
    pos[120:] = pos[120]
    assert times_stored(dataclasses.replace(clip, body_pos_w=pos), SHARE) == (1, 0)
    pos[:] = pos[0]
    assert times_stored(dataclasses.replace(clip, body_pos_w=pos), SHARE) == (1, 0)


@pytest.mark.parametrize("frames", [1, 2, 10])
def test_very_short_clips_show_no_pattern(frames):
    assert times_stored(repeated(walker(seconds=3.0).cut(0, frames, "short"), 1), SHARE) == (1, 0)
