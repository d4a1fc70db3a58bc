"""The benchmark of training speed: each run that it starts is one that training takes."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

import pytest

from benchmarks.train import ITERATIONS, run_arguments
from pipeline.learning.run_command import pairs
from pipeline.training.__main__ import _parser
from pipeline.training.chain import stages_of
from pipeline.training.config import PRESETS, changed_by_texts, preset
from pipeline.training.stage import Request


@pytest.mark.parametrize(
    ("name", "stage"),
    [(name, stage) for name in PRESETS for stage in ITERATIONS if (name, stage) != ("paper", "distillation")],
)
def test_a_run_trains_its_one_stage_as_long_as_asked(name: str, stage: str):
    asked = Namespace(bundle=Path("bundle"), device="cpu", num_envs=8, iterations=7)
    given = _parser().parse_args(run_arguments(asked, name, stage, "warp", "out"))
    config = changed_by_texts(preset(given.preset), pairs(given.set))
    request = Request(out=given.out, preset=given.preset, config=config, device=given.device, seed=given.seed)
    assert stages_of(request, given.stages) == (stage,)
    assert (config.simulation.num_envs, config.values()[ITERATIONS[stage]]) == (8, 7)
    assert (given.bundle, given.physics) == (asked.bundle, "warp")
