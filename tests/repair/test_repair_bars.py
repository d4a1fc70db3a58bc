"""The bars of the benchmark of repair that concern whole clips, on a few plants of a seed."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks.repair_clips import Sound
from benchmarks.repair_judge import judge, without_floor
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


@pytest.mark.parametrize("kind", ["floor_offset", "floor_drift", "foot_skate", "noise", "root_teleport"])
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


def test_ground_of_a_recordings_own_takes_nothing_from_what_is_planted(settings):
    lifted = turned(walker(fps=60.0), 0.0, (0.0, 0.0, 0.02))
    clip = without_floor(lifted, process(lifted, {}, settings=settings))
    sound = Sound(clip=clip, skeleton="", real=False, speed_m_s=1.2)
    clean = process(clip, {"skill": "walk"}, settings=settings)
    assert float(clean.numbers["floor_m"] or 0.0) == pytest.approx(0.0, abs=0.001)
    for seed in range(PLANTS):
        planted = plant("floor_offset", clip, np.random.default_rng(seed))
        verdict = judge("floor_offset", sound, planted, clean, settings)
        assert verdict.strength == pytest.approx(abs(planted.size or 0.0) / 0.03)
        assert verdict.located
        assert verdict.detected or verdict.strength < 1.0


def test_floor_that_the_sound_clip_is_told_of_already_is_not_found(settings):
    clip = turned(walker(fps=60.0), 0.0, (0.0, 0.0, 0.3))
    sound = Sound(clip=clip, skeleton="", real=False, speed_m_s=1.2)
    clean = process(clip, {"skill": "walk"}, settings=settings)
    unspoilt = dataclasses.replace(plant("floor_offset", clip, np.random.default_rng(0)), clip=clip, size=0.0)
    assert not judge("floor_offset", sound, unspoilt, clean, settings).detected
