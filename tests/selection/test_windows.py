"""Windows of clips whose velocities are known."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.files import settings as settings_file
from pipeline.selection import SKILLS, TRANSITION, Curation, find_windows
from tests.conftest import ROOT
from tests.factories.gliding import gliding_person, gliding_robot
from tests.factories.human_clips import turned

WINDOWS = settings_file.read(ROOT / "data" / "curation.yaml", Curation).windows

STEADY = [
    # forward, to the left, yaw rate, skill
    (0.0, 0.0, 0.0, "stand"),
    (0.0, 0.0, 1.2, "turn_left"),
    (0.1, 0.0, -1.2, "turn_right"),
    (0.1, 0.6, 0.0, "side_left"),
    (-0.2, -0.6, 0.1, "side_right"),
    (-0.7, 0.1, 0.0, "back"),
    (0.45, 0.0, 0.2, "walk_slow"),
    (1.0, 0.1, 0.0, "walk"),
    (1.0, 0.0, 0.8, "walk"),
    (1.6, -0.1, 0.0, "walk_fast_jog"),
    (2.6, 0.0, -0.3, "run"),
]

leg = st.tuples(
    st.floats(0.2, 2.0), st.floats(-1.5, 3.0), st.floats(-1.0, 1.0), st.floats(-2.0, 2.0)
)  # seconds, forward, to the left, yaw rate


def found(clip):
    return [(window.skill, window.start, window.stop) for window in find_windows(clip, settings=WINDOWS)]


@pytest.mark.parametrize(("forward", "left", "rate", "skill"), STEADY)
@pytest.mark.parametrize("glide", [gliding_person, gliding_robot])
def test_steady_motion_is_one_window_with_its_velocities(glide, forward, left, rate, skill):
    clip = glide([(4.0, forward, left, rate)])
    (window,) = find_windows(clip, settings=WINDOWS)
    assert (window.skill, window.start, window.stop) == (skill, 0, clip.frame_count)
    assert window.forward_m_s == pytest.approx(forward, abs=0.02)
    assert window.lateral_m_s == pytest.approx(left, abs=0.02)
    assert window.yaw_rate_rad_s == pytest.approx(rate, abs=0.02)
    assert window.off_skill_m_s == pytest.approx(0.0, abs=0.01)


def test_walking_diagonally_is_no_walk():
    assert [skill for skill, *_ in found(gliding_person([(4.0, 0.73, 0.57, 0.0)]))] == [TRANSITION]


def test_running_diagonally_is_a_run():
    assert [skill for skill, *_ in found(gliding_person([(3.0, 2.6, 1.7, 0.0)]))] == ["run"]


def test_windows_change_where_the_motion_does():
    legs = [
        (2.0, 0.0, 0.0, 0.0),
        (3.0, 1.0, 0.0, 0.0),
        (2.0, 0.0, 0.0, 1.5),
        (2.5, 2.6, 0.0, 0.0),
        (2.0, 0.0, 0.7, 0.0),
    ]
    windows = found(gliding_person(legs))
    assert [skill for skill, *_ in windows] == ["stand", "walk", "turn_left", "run", "side_left"]
    starts = np.array([start for _, start, _ in windows]) / 60.0
    assert starts == pytest.approx([0.0, 2.0, 5.0, 7.0, 9.5], abs=0.25)


def test_a_moment_of_another_skill_does_not_cut_a_window():
    windows = found(gliding_person([(2.0, 1.0, 0.0, 0.0), (0.3, 1.45, 0.0, 0.0), (2.0, 1.0, 0.0, 0.0)]))
    assert [skill for skill, *_ in windows] == ["walk"]


def test_hips_that_turn_with_each_step_do_not_make_a_turn():
    clip = gliding_person([(4.0, 1.0, 0.0, 0.0)])
    angle = 0.2 * np.sin(2.0 * np.pi * 2.0 * np.arange(clip.frame_count) / clip.fps)
    pos = clip.body_pos_w - clip.pos("pelvis")[:, None]
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y = pos[..., 0].copy(), pos[..., 1].copy()
    pos[..., 0], pos[..., 1] = cos * x - sin * y, sin * x + cos * y
    swaying = dataclasses.replace(clip, body_pos_w=pos + clip.pos("pelvis")[:, None])
    assert [skill for skill, *_ in found(swaying)] == ["walk"]


@settings(max_examples=25, deadline=None)
@given(st.lists(leg, min_size=1, max_size=6))
def test_windows_tile_the_clip_and_none_is_too_short(legs):
    clip = gliding_person(legs)
    windows = find_windows(clip, settings=WINDOWS)
    assert windows[0].start == 0
    assert windows[-1].stop == clip.frame_count
    assert all(one.stop == two.start and one.skill != two.skill for one, two in itertools.pairwise(windows))
    shortest = {skill: WINDOWS.shortest_s for skill in SKILLS} | {TRANSITION: WINDOWS.shortest_transition_s}
    if len(windows) > 1:
        lengths = [(window.stop - window.start) / clip.fps - shortest[window.skill] for window in windows]
        assert min(lengths) > -1.5 / WINDOWS.label_hz


@settings(max_examples=20, deadline=None)
@given(st.lists(leg, min_size=1, max_size=4), st.floats(-3.0, 3.0), st.floats(-50.0, 50.0))
def test_windows_do_not_change_under_yaw_and_translation(legs, yaw, shift):
    clip = gliding_person(legs)
    assert found(turned(clip, yaw, (shift, -2.0 * shift, 0.0))) == found(clip)


@settings(max_examples=15, deadline=None)
@given(st.lists(leg, min_size=1, max_size=4))
def test_mirrored_motion_has_mirrored_windows(legs):
    other = {"turn_left": "turn_right", "side_left": "side_right"}
    other |= {right: left for left, right in other.items()}
    mirrored = [(seconds, forward, -left, -rate) for seconds, forward, left, rate in legs]
    expected = [(other.get(skill, skill), start, stop) for skill, start, stop in found(gliding_person(legs))]
    assert found(gliding_person(mirrored)) == expected


@pytest.mark.parametrize("fps", [30.0, 50.0, 100.0, 120.0, 200.0])
def test_windows_do_not_depend_on_the_rate(fps):
    legs = [
        (1.5, 0.0, 0.0, 0.0),
        (2.0, 1.0, 0.0, 0.3),
        (1.5, 1.7, 0.0, 0.0),
        (1.5, -0.6, 0.0, 0.0),
        (2.0, 0.0, -0.5, 0.0),
    ]
    at_60, here = found(gliding_person(legs, fps=60.0)), found(gliding_person(legs, fps=fps))
    assert [skill for skill, *_ in here] == [skill for skill, *_ in at_60]
    starts_60, starts = (np.array([start for _, start, _ in each]) for each in (at_60, here))
    assert starts / fps == pytest.approx(starts_60 / 60.0, abs=0.07)


def with_gap(clip, start_s, stop_s):
    pos = clip.body_pos_w.copy()
    pos[round(start_s * clip.fps) : round(stop_s * clip.fps)] = np.nan
    return dataclasses.replace(clip, body_pos_w=pos)


def test_a_short_gap_is_bridged():
    clip = gliding_person([(5.0, 1.0, 0.0, 0.0)])
    (window,) = find_windows(with_gap(clip, 2.0, 2.3), settings=WINDOWS)
    assert window.skill == "walk"
    assert window.forward_m_s == pytest.approx(1.0, abs=0.01)
    assert window.recorded_share == pytest.approx(1.0 - 18 / 300, abs=1e-9)


def test_a_long_gap_is_a_window_of_its_own():
    clip = gliding_person([(5.0, 1.0, 0.0, 0.0)])
    windows = found(with_gap(clip, 2.0, 3.0))
    assert [skill for skill, *_ in windows] == ["walk", TRANSITION, "walk"]
    assert windows[1][1:] == pytest.approx((120, 180), abs=2)


def test_a_clip_without_any_sample_is_a_transition():
    clip = gliding_person([(2.0, 1.0, 0.0, 0.0)])
    (window,) = find_windows(with_gap(clip, 0.0, 2.0), settings=WINDOWS)
    assert (window.skill, window.recorded_share, window.forward_m_s) == (TRANSITION, 0.0, 0.0)


@pytest.mark.parametrize("frames", [1, 2, 5, 29])
def test_a_clip_shorter_than_any_window_is_a_transition(frames):
    clip = gliding_person([(2.0, 1.0, 0.0, 0.0)])
    assert found(clip.cut(0, frames, "short")) == [(TRANSITION, 0, frames)]


def test_a_teleport_is_no_run():
    clip = gliding_person([(4.0, 0.0, 0.0, 0.0)])
    pos = clip.body_pos_w.copy()
    pos[120:] += np.array([2.2, -1.0, 0.0])
    (window,) = find_windows(dataclasses.replace(clip, body_pos_w=pos), settings=WINDOWS)
    assert window.skill == "stand"
    assert window.forward_m_s == pytest.approx(0.0, abs=0.01)


def test_a_first_frame_far_away_does_not_change_the_windows():
    clip = gliding_person([(4.0, 1.0, 0.0, 0.0)])
    pos = clip.body_pos_w.copy()
    pos[0] -= np.array([30.0, 5.0, 0.0])
    assert found(dataclasses.replace(clip, body_pos_w=pos)) == [("walk", 0, 240)]
