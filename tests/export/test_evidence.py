"""A card states figures of the recipe's other seeds and of held-out trials, and refuses those of others."""

import argparse
import json

import pytest

from pipeline.deployment import digest, load_policy
from pipeline.export.__main__ import main
from pipeline.export.card import read_card
from pipeline.validation.deployed import Deployed
from tests.factories.networks import network_file

BUNDLE = {"database_digest": "d" * 64, "licence": {"strictest": "attribution", "allowed_use": "Any use."}}


def run_of(folder, robot, seed, cells, **options):
    """A validated training run."""
    (folder / "validation").mkdir(parents=True)
    policy = digest(load_policy(network_file(folder / "policy.npz", robot)))
    config = {"seed": seed, "options": {"ppo.init_std": 0.3, **options}, "stages": ["amp"], "processes": 1}
    write(folder / "config.json", {**config, "bundle": BUNDLE})
    write(folder / "done.json", {"gpu_seconds": 60.0 * (50 + seed), "seconds": 1.0})
    figures = {"required cells": cells, "speed error": None}
    write(folder / "validation" / "figures.json", {"policy": policy, "summary": f"{cells} of 100", "figures": figures})
    return folder


def write(path, value):
    path.write_text(json.dumps(value))
    return path


def verdict(path, run, **changed):
    words = ["passed"] * 3 + ["failed"] + ["not required"] * 2
    cells = [{"cell": str(at), "verdict": word, "reasons": []} for at, word in enumerate(words)]
    policy = load_policy(run / "policy.npz")
    gains = Deployed.gains(argparse.Namespace(task=policy.gains))  # as `booster-lab validate` writes them
    facts = {"suite": "held-out", "policy": digest(policy), "gains": gains, "cells": cells, "reasons": ["vx: slow"]}
    return write(path, {**facts, **changed})


@pytest.fixture
def runs(tmp_path, robot):
    return [run_of(tmp_path / f"seed{seed}", robot, seed, cells) for seed, cells in ((1, 97.0), (2, 95.0), (3, 99.0))]


def exported(tmp_path, runs, *more):
    out = tmp_path / "out"
    given = [str(runs[0]), "--name", "walk", "--compact", "--out", str(out)]
    return main([*given, *map(str, more)]), out


def test_the_card_states_other_seeds_and_held_out_trials(tmp_path, runs):
    unseen = verdict(tmp_path / "unseen.json", runs[0])
    status, out = exported(tmp_path, runs, "--beside", *runs[1:], "--held-out", unseen)
    assert status == 0
    card = read_card(out)
    assert card.figures["figures"]["required cells"] == 97.0
    assert {seed: each["figures"]["required cells"] for seed, each in card.figures["other seeds"].items()} == {
        "2": 95.0,
        "3": 99.0,
    }
    assert card.figures["held-out"] == {"passed": 3, "required": 4, "reasons": ["vx: slow"]}
    page = (out / "CARD.md").read_text()
    for row in (
        "| GPU minutes without the tracker's | 51.0 |",
        "| GPU minutes, seed 3 | 53.0 |",
        "| required cells | 97 (seed 2: 95, seed 3: 99) |",
        "| speed error | - (seed 2: -, seed 3: -) |",
        "| held-out trials | 3 of 4 required cells |",
    ):
        assert row in page


def test_a_run_of_another_recipe_and_a_seed_that_comes_twice_are_refused(tmp_path, runs, robot, capsys):
    other = run_of(tmp_path / "other", robot, 4, 100.0, **{"ppo.init_std": 0.5})
    assert exported(tmp_path, runs, "--beside", other)[0] == 2
    assert "in options, so it is not another seed of the same recipe" in capsys.readouterr().err
    later = run_of(tmp_path / "later", robot, 5, 100.0)
    config = json.loads((later / "config.json").read_text())
    write(later / "config.json", {**config, "commit": "of another version"})
    assert exported(tmp_path, runs, "--beside", later)[0] == 2
    assert "in commit, so it is not another seed of the same recipe" in capsys.readouterr().err
    assert exported(tmp_path, runs, "--beside", runs[1], runs[1])[0] == 2
    assert "seed 2 is given twice" in capsys.readouterr().err
    assert exported(tmp_path, runs, "--beside", runs[0])[0] == 2
    assert "seed 1 is given twice" in capsys.readouterr().err
    assert not (tmp_path / "out" / "card.json").exists()


def test_a_run_without_validation_is_refused(tmp_path, runs, capsys):
    (runs[2] / "validation" / "figures.json").unlink()
    assert exported(tmp_path, runs, "--beside", runs[2])[0] == 2
    error = capsys.readouterr().err
    assert "figures.json" in error and "repeat its command with the stage validation" in error


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"suite": "full"}, "not a verdict of the suite held-out"),
        ({"policy": "0" * 64}, "another policy"),
        ({"gains": {}}, "other gains"),
    ],
)
def test_a_verdict_by_another_suite_or_on_another_policy_is_refused(tmp_path, runs, capsys, changed, said):
    unseen = verdict(tmp_path / "unseen.json", runs[0], **changed)
    assert exported(tmp_path, runs, "--held-out", unseen)[0] == 2
    error = capsys.readouterr().err
    assert said in error and "booster-lab validate" in error
