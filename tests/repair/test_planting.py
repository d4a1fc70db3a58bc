"""Feet that slide slowly are planted, as walkers whose true way is known show; feet of a run do not slide in flight."""

import dataclasses

import numpy as np
import pytest

from pipeline.clips.human_clip import HumanClip
from pipeline.generator import RECIPES, generate
from pipeline.repair import process
from pipeline.repair.contacts import both_feet
from pipeline.repair.skating import FAST, _slowest_fifth, planted
from tests.factories.human_clips import Gait, walker


def slid(clip: HumanClip, velocity_m_s: tuple[float, float]) -> HumanClip:
    way = np.arange(clip.frame_count)[:, None] / clip.fps * np.array(velocity_m_s)
    pos_w = clip.body_pos_w.copy()
    pos_w[..., :2] += way[:, None]
    return dataclasses.replace(clip, body_pos_w=pos_w, contacts=None)


def way_of(clip: HumanClip) -> np.ndarray:
    pos_w = clip.pos("pelvis")[:, :2]
    return np.linalg.norm(pos_w - pos_w[0], axis=1)


@pytest.mark.parametrize("velocity_m_s", [(0.12, 0.0), (0.0, 0.12), (-0.1, 0.1)])
def test_a_slow_slide_is_taken_out_and_recorded(settings, velocity_m_s):
    clip = walker(seconds=5.0, gait=Gait(speed_m_s=1.0))
    truth = process(clip, {}, settings=settings).pieces[0].clip
    outcome = process(slid(clip, velocity_m_s), {}, settings=settings)
    (piece,) = outcome.pieces
    slide_m = 5.0 * np.hypot(*velocity_m_s)
    np.testing.assert_allclose(way_of(piece.clip), way_of(truth), atol=0.25 * slide_m)
    assert piece.numbers["planted_m"] == pytest.approx(slide_m, rel=0.2)
    assert piece.numbers["stance_slip_m_s"] < 0.03
    reason = next(reason for reason in outcome.reasons if reason.code == "foot_skate")
    assert reason.effect == "repaired"
    assert reason.value == pytest.approx(np.hypot(*velocity_m_s), abs=0.03)


def test_the_body_takes_no_step_in_velocity_at_the_ends_of_a_slide():
    clip = walker(seconds=5.0, gait=Gait(speed_m_s=1.0))
    pos_w = clip.body_pos_w.copy()
    slides = np.arange(clip.frame_count)
    slides = (slides >= 100) & (slides < 200)
    pos_w[..., 1] += np.cumsum(0.12 * slides / clip.fps)[:, None]
    sliding = dataclasses.replace(clip, body_pos_w=pos_w)
    found = planted(sliding, both_feet(sliding, 0.0), sliding.contacts, slice(100, 200), 0.15)
    taken_off = np.diff(found.clip.pos("pelvis")[:, 1] - sliding.pos("pelvis")[:, 1]) * clip.fps
    assert taken_off[120:180].mean() == pytest.approx(-0.12, abs=0.02)
    assert np.abs(np.diff(taken_off)).max() < 0.05, "no step of the velocity [m/s] from one frame to the next"
    assert np.abs(taken_off[:90]).max() < 1e-9
    assert np.abs(taken_off[210:]).max() < 1e-9


def test_a_fast_slide_is_refused(settings):
    outcome = process(slid(walker(seconds=5.0), (0.2, 0.0)), {}, settings=settings)
    assert not outcome.pieces
    assert {(reason.code, reason.effect) for reason in outcome.reasons} == {("foot_skate", "rejected")}


def test_feet_that_stand_are_not_planted(settings):
    clip = walker(seconds=5.0)
    numbers = process(clip, {}, settings=settings).pieces[0].numbers
    assert (numbers["planted_m"], numbers["planted_m_s"]) == (0.0, 0.0)


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
@pytest.mark.parametrize("name", ["run_easy", "run_fast"])
def test_a_run_does_not_skate_at_any_rate(settings, name, fps):
    clip = generate(dataclasses.replace(RECIPES[name], name=name, fps=fps)).clip
    outcome = process(clip, {"skill": "run"}, settings=settings)
    assert "foot_skate" not in {reason.code for reason in outcome.reasons}


def test_frames_in_the_air_do_not_count_among_the_slowest_fifth():
    step = np.array([0.02, 0.03, 0.4, 0.9, FAST, FAST, FAST, 1.1, FAST, FAST])
    np.testing.assert_array_less(_slowest_fifth(np.tile(step, 6), 25)[12:-12], 0.05)
    assert _slowest_fifth(np.full(40, FAST), 25).min() == FAST


def test_what_a_slide_is_said_to_be_exceeds_what_is_allowed(settings):
    for speed in (0.17, 0.2, 0.3):
        outcome = process(slid(walker(seconds=5.0), (speed, 0.0)), {}, settings=settings)
        for reason in outcome.reasons:
            assert reason.value > reason.limit
