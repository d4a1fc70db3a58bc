"""The bars of the benchmark of repair that concern whole clips, on a few plants of a seed."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks.repair import kind_bars
from benchmarks.repair_clips import Sound
from benchmarks.repair_floors import FLOOR_NUMBER, GENERATED, REAL, TOLD_BEFORE, floor_verdict, tracked_badly
from benchmarks.repair_judge import Verdict, judge
from pipeline.clips.outcome import Outcome
from pipeline.files import settings as settings_files
from pipeline.generator import RECIPES, generate
from pipeline.repair import RepairSettings, process
from tests.factories.human_clips import turned, walker
from tests.factories.planted_defects import plant

PLANTS = 8


@pytest.fixture(scope="module")
def settings(root) -> RepairSettings:
    return settings_files.read(root / "data" / "repair.yaml", RepairSettings)


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


def test_floor_of_a_recording_matters_by_the_plant_alone_and_goes_unsaid_where_its_own_ground_takes_it_away(settings):
    clip = turned(walker(fps=60.0), 0.0, (0.0, 0.0, -0.02))
    sound = Sound(clip=clip, skeleton="", real=True, speed_m_s=1.2)
    told = {}
    for sign in (-1.0, 1.0):
        moved = turned(clip, 0.0, (0.0, 0.0, 0.04 * sign))
        drawn = plant("floor_offset", clip, np.random.default_rng(0))
        planted = dataclasses.replace(drawn, clip=moved, size=0.04 * sign, strength=0.04 / 0.03)
        verdict = floor_verdict("floor_offset", sound, REAL, planted, process(moved, {}, settings=settings))
        assert verdict.strength == pytest.approx(0.04 / 0.03)
        assert verdict.located is None
        told[sign] = verdict.detected
    assert told == {-1.0: True, 1.0: False}


def test_rates_of_floors_are_by_group_and_recordings_told_of_before_are_held_to_nothing():
    verdicts = [
        Verdict(kind="floor_offset", clip="", strength=2.0, detected=detected, located=located, text="", group=group)
        for detected, located, group in (
            (True, True, GENERATED),
            (True, False, GENERATED),
            (False, None, REAL),
            (True, None, REAL),
            (False, None, TOLD_BEFORE),
        )
    ]
    bars = {bar.name: (bar.value, bar.holds) for bar in kind_bars("floor_offset", verdicts)}
    assert bars == {
        "floor_offset (4 of 4): found": (75.0, False),
        "floor_offset, generated (2 of 2): found": (100.0, True),
        "floor_offset, generated: right": (50.0, False),
        "floor_offset, real (2 of 2): found": (50.0, False),
        "floor_offset, real, told of without a plant (1 of 1): still told": (0.0, None),
    }
