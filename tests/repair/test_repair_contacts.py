"""Contact labels against the truth of motions whose feet are planted by construction."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.repair_quality import f1
from pipeline.generator import RECIPES, generate
from pipeline.repair import process
from tests.factories.human_clips import Gait, standing, walker


@pytest.mark.parametrize("name", ["walk", "run_easy", "back", "side_left", "turn_left", "start_stop"])
def test_labels_agree_with_the_generator(name, settings):
    clip = generate(RECIPES[name]).clip
    skill = "run" if name.startswith("run") else "walk"
    piece = process(clip, {"skill": skill}, settings=settings).pieces[0]
    assert f1(piece.clip.contacts, clip.contacts) >= 0.98


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
@pytest.mark.parametrize("noise", [0.0, 0.0005])
def test_labels_agree_with_an_analytic_walker(fps, noise, settings):
    clip = walker(fps=fps, noise=noise)
    piece = process(clip, {"skill": "walk"}, settings=settings).pieces[0]
    assert f1(piece.clip.contacts, clip.contacts) >= 0.95


def test_standing_person_stands_on_both_feet(settings):
    piece = process(standing(), {"skill": "stand"}, settings=settings).pieces[0]
    assert piece.clip.contacts.all()
    assert piece.numbers["flight_share"] == 0.0


def test_labels_do_not_depend_on_where_the_floor_lies(settings):
    clip = walker(fps=60.0, gait=Gait(speed_m_s=0.9, stride_s=1.2))
    lifted = walker(fps=60.0, gait=Gait(speed_m_s=0.9, stride_s=1.2))
    lifted.body_pos_w[..., 2] += 0.7
    labels = [process(one, {}, settings=settings).pieces[0].clip.contacts for one in (clip, lifted)]
    np.testing.assert_array_equal(*labels)


def test_slip_of_a_planted_foot_is_a_few_mm_per_second(settings):
    piece = process(generate(RECIPES["walk"]).clip, {"skill": "walk"}, settings=settings).pieces[0]
    assert piece.numbers["stance_slip_m_s"] < 0.005


@pytest.mark.parametrize("slide_m_s", [0.15, 0.2, 0.3])
def test_slip_measures_how_fast_the_feet_slide(slide_m_s, settings):
    rejected = process(walker(fps=60.0, gait=Gait(slide_m_s=slide_m_s)), {"skill": "walk"}, settings=settings)
    skate = next(reason for reason in rejected.reasons if reason.code == "foot_skate")
    assert skate.value == pytest.approx(slide_m_s, rel=0.2)
