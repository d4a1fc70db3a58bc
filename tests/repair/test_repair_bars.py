"""The bars of the benchmark of repair that concern whole clips, on a few plants of a seed."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks import repair_called_clean
from benchmarks.repair import kind_bars
from benchmarks.repair_called_clean import called_clean_bars, peak_g
from benchmarks.repair_clips import Sound
from benchmarks.repair_floors import (
    AS_IT_IS,
    FLOOR_NUMBER,
    GENERATED,
    REAL,
    WANDERING,
    floor_verdict,
    put_on_ground,
    smooth_way,
    tracked_badly,
    wander,
)
from benchmarks.repair_judge import Verdict, judge
from pipeline.clips.human_clip import body
from pipeline.clips.outcome import Outcome
from pipeline.generator import RECIPES, generate
from pipeline.repair import process
from tests.factories.human_clips import turned, walker
from tests.factories.planted_defects import plant

PLANTS = 8


@pytest.fixture(scope="module")
def sound_clips(settings) -> list[tuple[Sound, Outcome]]:
    sounds = [
        Sound(clip=generate(RECIPES[name]).clip, skeleton="booster_lab", real=False, speed_m_s=speed)
        for name, speed in (("walk", 0.95), ("curve_left", 1.0))
    ]
    return [(sound, process(sound.clip, {"skill": sound.skill}, settings=settings)) for sound in sounds]


@pytest.mark.parametrize("kind", ["foot_skate", "noise", "root_teleport"])
def test_planted_defects_that_matter_are_found_and_right(kind, sound_clips, settings):
    counted = []
    for seed in range(PLANTS):
        sound, clean = sound_clips[seed % len(sound_clips)]
        planted = plant(kind, sound.clip, np.random.default_rng(seed))
        verdict = judge(kind, sound, planted, clean, settings)
        if verdict.strength >= 1.0:
            counted.append(verdict)
    assert len(counted) >= 2
    assert [one.text for one in counted if not (one.detected and one.located)] == []


@pytest.mark.parametrize("kind", list(FLOOR_NUMBER))
def test_floor_under_badly_tracked_motion_is_told_and_right_within_5_mm_of_the_truth(kind, sound_clips, settings):
    counted, errors_m = [], []
    for seed in range(PLANTS):
        rng = np.random.default_rng(seed)
        sound, _ = sound_clips[seed % len(sound_clips)]
        planted = plant(kind, sound.clip, rng)
        said = process(tracked_badly(planted.clip, rng), {"skill": "walk"}, settings=settings)
        verdict = floor_verdict(kind, sound, GENERATED, planted, said)
        errors_m.append(abs(float(said.numbers[FLOOR_NUMBER[kind]] or 0.0) - (planted.size or 0.0)))
        if verdict.strength >= 1.0:
            counted.append(verdict)
    assert len(counted) >= 2
    assert [one.text for one in counted if not (one.detected and one.located)] == []
    assert float(np.median(errors_m)) > 1e-4, "the estimate is that of a clean clip: nothing was tested"


@pytest.mark.parametrize("kind", list(FLOOR_NUMBER))
def test_no_floor_is_told_under_badly_tracked_motion_without_a_plant(kind, sound_clips, settings):
    for seed in range(PLANTS):
        sound, _ = sound_clips[seed % len(sound_clips)]
        spoilt = tracked_badly(sound.clip, np.random.default_rng(seed))
        assert kind not in {one.code for one in process(spoilt, {"skill": "walk"}, settings=settings).reasons}


@pytest.mark.parametrize("kind", list(FLOOR_NUMBER))
@pytest.mark.parametrize(("off_m", "right"), [(0.004, True), (-0.004, True), (0.006, False), (-0.006, False)])
def test_floor_of_the_generator_is_right_by_its_distance_from_the_truth(kind, off_m, right, sound_clips):
    sound, _ = sound_clips[0]
    planted = plant(kind, sound.clip, np.random.default_rng(0))
    said = Outcome(numbers={FLOOR_NUMBER[kind]: (planted.size or 0.0) + off_m})
    verdict = floor_verdict(kind, sound, GENERATED, planted, said)
    assert (verdict.detected, verdict.located) == (False, right)


def test_floor_of_a_recording_as_it_is_goes_unsaid_where_its_own_ground_takes_the_plant_away(settings):
    clip = turned(walker(fps=60.0), 0.0, (0.0, 0.0, -0.02))
    sound = Sound(clip=clip, skeleton="", real=True, speed_m_s=1.2)
    told = {}
    for sign in (-1.0, 1.0):
        moved = turned(clip, 0.0, (0.0, 0.0, 0.04 * sign))
        drawn = plant("floor_offset", clip, np.random.default_rng(0))
        planted = dataclasses.replace(drawn, clip=moved, size=0.04 * sign, strength=0.04 / 0.03)
        verdict = floor_verdict("floor_offset", sound, AS_IT_IS, planted, process(moved, {}, settings=settings))
        assert verdict.strength == pytest.approx(0.04 / 0.03)
        assert verdict.located is None
        told[sign] = verdict.detected
    assert told == {-1.0: True, 1.0: False}


@pytest.mark.parametrize("kind", list(FLOOR_NUMBER))
def test_floor_of_a_recording_that_was_put_on_its_ground_is_what_was_planted(kind, settings):
    clip = turned(walker(fps=60.0), 0.0, (0.0, 0.0, -0.04))
    pos = clip.body_pos_w + 0.06 * np.linspace(-0.5, 0.5, clip.frame_count)[:, None, None] * [0.0, 0.0, 1.0]
    level = put_on_ground(dataclasses.replace(clip, body_pos_w=pos), settings)
    assert process(level, {}, settings=settings).reasons == ()
    sound = Sound(clip=level, skeleton="", real=True, speed_m_s=1.2)
    for seed in range(4):
        planted = plant(kind, level, np.random.default_rng(seed))
        verdict = floor_verdict(kind, sound, REAL, planted, process(planted.clip, {}, settings=settings))
        assert verdict.located, verdict.text
        assert verdict.detected or verdict.strength < 1.0, verdict.text


def test_wander_has_neither_mean_nor_slope_in_all_frames_nor_in_those_that_are_kept():
    for seed in range(4):
        rng = np.random.default_rng(seed)
        frames, start, length = 480, int(rng.integers(100)), int(rng.integers(60, 280))
        way = wander(smooth_way(frames, 60.0, rng), slice(start, start + length))
        kept = np.delete(np.arange(frames), np.s_[start : start + length])
        assert np.sqrt((way**2).mean(axis=0)) == pytest.approx(0.005)
        assert np.abs(np.diff(way, axis=0)).max() < 0.004
        for which in (np.arange(frames), kept):
            assert np.polyfit(which / frames, way[which], 1) == pytest.approx(0.0, abs=1e-9)


def test_rates_of_floors_are_by_group_and_recordings_as_they_are_and_wandering_are_held_to_nothing():
    verdicts = [
        Verdict(kind="floor_offset", clip="", strength=2.0, detected=detected, located=located, text="", group=group)
        for detected, located, group in (
            (True, True, GENERATED),
            (True, False, GENERATED),
            (False, True, REAL),
            (True, True, REAL),
            (False, None, AS_IT_IS),
            (True, False, WANDERING),
        )
    ]
    bars = {bar.name: (bar.value, bar.holds) for bar in kind_bars("floor_offset", verdicts)}
    assert bars == {
        "floor_offset (4 of 4): found": (75.0, False),
        "floor_offset, generated (2 of 2): found": (100.0, True),
        "floor_offset, generated: right": (50.0, False),
        "floor_offset, real (2 of 2): found": (50.0, False),
        "floor_offset, real: right": (100.0, True),
        "floor_offset, real, as they are (1 of 1): found": (0.0, None),
        "floor_offset, real, wandering (1 of 1): found": (100.0, None),
        "floor_offset, real, wandering: right": (0.0, None),
    }


def test_feet_that_accelerate_as_none_can_are_told_from_those_that_swing(monkeypatch):
    clip = walker(fps=120.0, seconds=6.0)
    monkeypatch.setitem(repair_called_clean.REAL, clip.name, (0, 500))
    usual = peak_g(clip, "left", 0, clip.frame_count)
    pos = clip.body_pos_w.copy()
    pos[600:650, body("right_toe"), 0] += 0.1
    spoilt = Sound(clip=dataclasses.replace(clip, body_pos_w=pos), skeleton="", real=True, speed_m_s=1.2)
    share, there, elsewhere, times = called_clean_bars(spoilt, 50, (10, 1000))
    assert share.value == pytest.approx(100.0 * 60 / (1000 + clip.frame_count - 500))
    assert there.value == pytest.approx(0.1 * 120.0**2 / 9.81, rel=0.1)
    assert elsewhere.value == pytest.approx(usual, rel=0.1)
    assert times.holds
    sound = Sound(clip=clip, skeleton="", real=True, speed_m_s=1.2)
    assert not called_clean_bars(sound, 50, (10, 1000))[-1].holds
