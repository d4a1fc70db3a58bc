"""The bars of the benchmark of repair that concern whole clips, on a few plants of a seed."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.repair_clips import Sound
from benchmarks.repair_judge import judge
from pipeline.clips.outcome import Outcome
from pipeline.files import settings as settings_files
from pipeline.generator import RECIPES, generate
from pipeline.repair import RepairSettings, process
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
