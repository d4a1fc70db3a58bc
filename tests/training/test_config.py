"""Options: their number, units and sources, presets, texts, and sentences about wrong values."""

from __future__ import annotations

import pytest

from pipeline.learning.training_error import TrainingError
from pipeline.training.__main__ import options_table
from pipeline.training.config import (
    PAPER,
    PRESETS,
    RECIPE,
    Config,
    changed_by_texts,
    changed_from,
    preset,
    texts_of,
)


def test_there_are_at_most_fifty_options():
    assert len(list(RECIPE.options())) <= 50


def test_every_option_has_a_meaning_a_unit_and_a_source():
    lacking = [
        name for name, _, facts in RECIPE.options() if not all(facts[part] for part in ("text", "unit", "source"))
    ]
    assert not lacking


def test_the_recipe_is_the_default_of_every_option():
    assert set(PRESETS) == {"recipe", "paper"}
    assert preset("recipe") == Config()
    assert changed_from("recipe", Config()) == {}
    assert changed_from("paper", PAPER) == {}


def test_the_papers_setting_has_nothing_of_the_recipes_last_part():
    values = PAPER.values()
    assert values["randomization.friction"] == (0.4, 1.2)
    assert values["rewards.power"] == 0.0 and values["ppo.final_std"] == 1.0
    assert values["ppo.final_kl"] == values["ppo.desired_kl"]


def test_options_round_trip_through_texts():
    changed = changed_from("recipe", PAPER)
    texts = dict(text.split("=", 1) for text in texts_of(changed))
    assert changed_by_texts(RECIPE, texts) == PAPER


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("discriminator.stile", "0.5", r"unknown option 'discriminator.stile'; the options are: simulation.num_envs"),
        ("simulation.num_envs", "many", "option 'simulation.num_envs' is 'many'; it must look like '4096'"),
        ("simulation.num_envs", "0", r"option 'simulation.num_envs' is 0; 1 to 65536 is allowed \[count\]"),
        ("simulation.num_envs", "4096.5", "must look like '4096'"),
        ("randomization.friction", "0.4", "option 'randomization.friction' is '0.4'; it must look like '0.3,1.2'"),
        ("randomization.friction", "1.2,0.4", "the smaller number comes first"),
        ("discriminator.loss", "hinge", "'discriminator.loss' is 'hinge'; it must be wasserstein or bce"),
        ("discriminator.style", "1.5", r"is 1.5; 0 to 1 is allowed \[share\]"),
        ("discriminator.style", "nan", r"is nan; 0 to 1 is allowed"),
        ("rewards.track_all", "inf", "is inf; a finite number of at least 0 is allowed"),
        ("rewards.power", "0.1", r"is 0.1; a finite number of at most 0 is allowed \[1/J\]"),
        ("discriminator.by_command", "maybe", "must look like 'true'"),
        ("commands.standing_share", "0.9", "standing_share, single_axis_share and fast_share sum to 1.55"),
    ],
)
def test_a_wrong_option_gets_a_sentence(name, text, message):
    with pytest.raises(TrainingError, match=message):
        changed_by_texts(RECIPE, {name: text})


def test_pushes_so_often_that_the_discriminator_reads_nothing_get_a_sentence():
    often = {"pushes.interval_s": "0.5,1.0"}
    with pytest.raises(TrainingError, match="at most 1 s, but the discriminator ignores windows for 1 s after a push"):
        changed_by_texts(RECIPE, often)
    assert changed_by_texts(RECIPE, {**often, "discriminator.style": "0"}).pushes.interval_s == (0.5, 1.0)


def test_an_unknown_preset_gets_a_sentence():
    with pytest.raises(TrainingError, match="unknown preset 'papr'; the presets are: recipe, paper"):
        preset("papr")


def test_the_list_shows_both_presets():
    lines = options_table().splitlines()
    assert len(lines) == 1 + len(list(RECIPE.options()))
    (line,) = (line for line in lines if line.startswith("discriminator.loss"))
    assert line.split()[:3] == ["discriminator.loss", "bce", "wasserstein"]
