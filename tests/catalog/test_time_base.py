"""Rates held against gravity and gait, on motion whose true rate is known."""

import csv
import dataclasses

import numpy as np
import pytest

from pipeline.catalog import CatalogSettings, judge
from pipeline.catalog.time_base import Person, forward_steps
from pipeline.clips.human_clip import HumanClip
from pipeline.files import settings as settings_file
from pipeline.readers import Statement, read_motion
from tests.conftest import ROOT
from tests.factories.human_clips import Gait, standing, turned, walker
from tests.factories.runner import FLIGHT_S, STEP_S, runner

SETTINGS = settings_file.read(ROOT / "data" / "catalog.yaml", CatalogSettings).time_base
FACTORS = (1 / 5, 1 / 4, 1 / 3, 1 / 2, 1 / 1.5, 1.5, 2.0, 3.0, 4.0, 5.0)


def judged(clip, skeleton, settings):
    return judge(Person(clip=clip), skeleton, settings)


def at(clip, fps):
    return dataclasses.replace(clip, fps=fps)


@pytest.mark.parametrize("fps", [60.0, 100.0, 120.0, 240.0])
def test_a_runner_falls_with_gravity_in_every_flight(fps):
    clip = runner(fps)
    flights = Person(clip=clip).flights
    assert len(flights.phases) >= 8
    assert flights.fall * fps**2 == pytest.approx(np.full(len(flights.fall), 9.81), rel=0.02)
    assert flights.frames.max() / fps <= FLIGHT_S + 2.0 / fps


def test_a_walker_never_flies():
    assert Person(clip=walker(seconds=10.0)).flights.phases == ()


@pytest.mark.parametrize("true_fps", [30.0, 60.0, 100.0, 120.0])
def test_right_rates_of_runs_are_kept(true_fps):
    assert not judged(runner(true_fps), "", SETTINGS).contradicted


@pytest.mark.parametrize("true_fps", [60.0, 120.0, 240.0])
@pytest.mark.parametrize("factor", FACTORS)
def test_wrong_rates_of_runs_are_found_and_the_true_one_with_them(true_fps, factor):
    found = judged(at(runner(true_fps), true_fps * factor), "", SETTINGS)
    assert found.contradicted
    assert found.certain
    assert found.fps == true_fps
    assert found.ratio == pytest.approx(1.0 / factor, rel=0.03)


def test_two_rates_that_fit_are_not_chosen_between():
    found = judged(at(runner(108.0), 30.0), "", SETTINGS)
    assert found.contradicted
    assert set(found.candidates) == {100.0, 120.0}
    assert found.fps is None


def test_what_a_skeleton_is_usually_recorded_at_decides_between_two_rates():
    assert judged(at(runner(108.0), 30.0), "cmu_daz", SETTINGS).fps == 120.0


@pytest.mark.parametrize("declared", [24.0, 30.0, 100.0, 120.0, 240.0])
def test_a_walk_at_a_rate_that_its_source_does_not_use_gets_the_usual_one(declared):
    clip = at(walker(seconds=10.0), declared)
    assert judged(clip, "lafan1", SETTINGS).fps == 60.0


def test_a_walk_resampled_to_a_rate_that_its_source_does_not_use_keeps_it():
    assert not judged(walker(seconds=10.0, fps=50.0), "lafan1", SETTINGS).contradicted


def test_24_and_25_hz_are_not_told_apart_but_the_nearest_is_taken():
    assert judged(at(runner(25.0, seconds=10.0), 60.0), "", SETTINGS).fps in (None, 24.0, 25.0)


@pytest.mark.parametrize("factor", [1 / 4, 1 / 2, 2.0, 4.0])
def test_wrong_rates_of_walks_are_found_by_their_steps(factor):
    found = judged(at(walker(seconds=10.0), 60.0 * factor), "", SETTINGS)
    assert found.gravity is None
    assert found.contradicted
    assert found.certain
    assert 60.0 in found.candidates


@pytest.mark.parametrize("stride_s", [1.0, 1.1, 1.25])
def test_people_may_walk_faster_and_slower_than_usual(stride_s):
    clip = walker(seconds=10.0, gait=Gait(speed_m_s=1.2, stride_s=stride_s))
    found = judged(clip, "", SETTINGS)
    assert found.gait is not None
    assert not found.contradicted


def test_who_does_not_walk_is_not_judged():
    found = judged(standing(seconds=5.0), "", SETTINGS)
    assert (found.gravity, found.gait, found.ratio, found.contradicted) == (None, None, None, False)


def test_steps_are_measured_in_frames_and_metres():
    steps = forward_steps(Person(clip=walker(seconds=10.0, fps=60.0, gait=Gait(speed_m_s=1.2, stride_s=1.1))))
    assert len(steps.frames) >= 14
    assert np.median(steps.frames) == pytest.approx(33.0, abs=1.0)
    assert np.median(steps.length) == pytest.approx(0.66, abs=0.02)


def test_a_run_has_steps_of_its_cadence():
    steps = forward_steps(Person(clip=runner(120.0)))
    assert np.median(steps.frames) / 120.0 == pytest.approx(STEP_S, abs=0.01)


def test_the_judgement_does_not_depend_on_place_and_heading():
    clip = runner(120.0)
    here, there = judged(clip, "", SETTINGS), judged(turned(clip, 2.0, (40.0, -3.0, 0.4)), "", SETTINGS)
    assert there.gravity.fps == pytest.approx(here.gravity.fps, rel=1e-6)
    assert there.gait.fps == pytest.approx(here.gait.fps, rel=1e-6)


def test_missing_frames_and_a_first_frame_elsewhere_do_not_disturb():
    clip = runner(120.0, seconds=6.0)
    pos = clip.body_pos_w.copy()
    pos[0] += 20.0
    pos[300:340] = np.nan
    found = judged(at(dataclasses.replace(clip, body_pos_w=pos), 25.0), "", SETTINGS)
    assert found.fps == 120.0


def test_a_clip_without_any_sample_is_not_judged():
    clip = runner(60.0)
    empty = dataclasses.replace(clip, body_pos_w=np.full_like(clip.body_pos_w, np.nan))
    assert not judged(empty, "", SETTINGS).contradicted
    assert np.isnan(Person(clip=empty).leg_length)


def real_people(mocap):
    with (mocap / "index.csv").open() as stream:
        files = [row["file"] for row in csv.DictReader(stream)]
    for file in files:
        read = read_motion(mocap / file, file, Statement(fps=120.0 if file.endswith(".amc") else None))
        if isinstance(read.clip, HumanClip) and "isaaclab_amp" not in file:
            true_fps = 120.0 if file == "cmu_bvh/02_03.bvh" else read.clip.fps
            yield file, read.skeleton, at(read.clip, true_fps)


@pytest.mark.shared
def test_of_real_recordings_right_rates_are_kept_and_no_wrong_one_is_replaced_by_another(mocap):
    decided = 0
    for file, skeleton, clip in real_people(mocap):
        assert not judged(clip, skeleton, SETTINGS).contradicted, file
        for factor in FACTORS:
            found = judged(at(clip, clip.fps * factor), skeleton, SETTINGS)
            if found.certain and found.fps is not None:
                assert found.fps == clip.fps, (file, factor)
                decided += 1
            if found.gravity is not None:
                assert found.certain, (file, factor)
                assert found.fps == clip.fps, (file, factor)
    assert decided > 100
