"""What the reward pays: walking more than standing, and a step that keeps a robot up more than it costs."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from pipeline.training.bundle import read_bundle
from pipeline.training.presets import preset
from pipeline.training.reward_balance import DISCOUNT, nominal_environment, play, standing_pays, walks
from pipeline.training.reward_table import table
from tests.factories.training_bundle import small_bundle

PRESET = "gated_style"
MOVES = torch.tensor([(0.3, 0.0, 0.0), (-0.3, 0.0, 0.0), (0.0, 0.3, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)])
TOLD = torch.tensor([(0.27, 0.0, 0.0), (-0.31, 0.0, 0.0), (0.0, 0.27, 0.0), (0.965, 0.0, 0.0), (1.99, 0.0, 0.0)])
"""What the shipped policy has to be told to walk so."""


@pytest.fixture(scope="module")
def bundle(tmp_path_factory, root, robot):
    return read_bundle(small_bundle(tmp_path_factory.mktemp("balance"), root, robot))


@pytest.fixture(scope="module")
def walked(bundle, root):
    env = nominal_environment(bundle, preset(PRESET), len(MOVES))
    with np.load(root / "robots" / "t1" / "policies" / "walk" / "policy.npz") as arrays:
        policy = dict(arrays)
    return play(env, walks(policy, TOLD), MOVES, seconds=2.0)


@pytest.mark.parametrize("number", range(len(MOVES)))
def test_walking_pays_more_than_standing(walked, number):
    """Even from rest, and of the first 2 s alone."""
    assert walked[number].ended == "time"
    stands = standing_pays(preset(PRESET), MOVES)[number].item()
    assert walked[number].total > 1.25 * stands


def test_what_was_paid_is_told_by_term(walked):
    names = {row.name for row in table(preset(PRESET))}
    assert set(walked[0].terms) == names
    assert walked[0].terms["progress"] > 0.0
    assert walked[0].terms["termination"] == walked[0].terms["stalled"] == 0.0


def test_what_standing_pays_is_the_tables_own_sum():
    """A preset of one tracking term, by hand: exp(-1) + 2 a second for 76 steps, less the stall."""
    options = preset("paper_flat").changed(stall=True, stall_s=0.75, stall_penalty=0.5)
    steps = 76
    lasting = 0.02 * sum(DISCOUNT**step for step in range(steps))
    expected = 3.0 * (np.exp(-1.0) + 2.0) * lasting - 2.0 * DISCOUNT**steps
    assert standing_pays(options, torch.tensor([[0.5, 0.0, 0.0]])).item() == pytest.approx(expected, rel=1e-5)
    for_ever = standing_pays(options, torch.zeros(1, 3)).item()
    assert for_ever == pytest.approx(9.0 * 0.02 / (1.0 - DISCOUNT), rel=1e-5)


def test_the_papers_setting_pays_standing_two_thirds_of_walking():
    """Why the paper's preset stands: most of what walking could get at all, for ever and without a risk."""
    stands = standing_pays(preset("paper_flat"), MOVES)
    most = 9.0 * 0.02 / (1.0 - DISCOUNT)
    assert (stands > 0.66 * most).all()


def test_a_step_that_keeps_it_up_costs_less_than_a_fall():
    """A second of stepping with a foot in the air and joints at 15 rad/s, all of it punished, against a fall's end."""
    options = preset(PRESET)
    stepping = options.standing_still * (1.0 + 0.05 * 15.0) * 0.02 * (1.0 - DISCOUNT**50) / (1.0 - DISCOUNT)
    fall = 200.0 * 0.02 * DISCOUNT**50
    assert stepping < 0.6 * fall
