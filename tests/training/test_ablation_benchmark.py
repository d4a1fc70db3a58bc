"""The ablation benchmark: arms as texts, and figures of a run from its files."""

from __future__ import annotations

import argparse
import json
import math
import shutil
from pathlib import Path

import pytest

from benchmarks.ablation import arm_of, bars_of, draw, figures_of, train
from pipeline.training.policy_figures import as_json, discriminator_figures, style_figures
from tests.factories.training_bundle import small_bundle

SHIPPED = Path("robots/t1/policies/walk/policy.npz")


def test_an_arm_is_a_bundle_and_options_of_one_or_two_numbers():
    arm = arm_of("soft=data/bundle,discriminator.loss=bce,randomization.friction=0.4,1.0,ppo.entropy=0.01")
    assert (arm.name, arm.bundle) == ("soft", Path("data/bundle"))
    assert arm.options == ("discriminator.loss=bce", "randomization.friction=0.4,1.0", "ppo.entropy=0.01")
    assert arm_of("plain=b").options == ()


@pytest.mark.parametrize("text", ["soft", "=b", "soft=", "a/b=c", "soft=b,fast"])
def test_an_arm_of_another_form_is_refused(text):
    with pytest.raises(argparse.ArgumentTypeError, match="'"):
        arm_of(text)


def test_the_discriminators_figures_are_the_worst_of_the_second_half(tmp_path):
    rows = ["iteration,accuracy,d_expert,d_policy", "1,0.99,9,-9", "2,0.99,9,-9", "3,0.8,0.5,-0.5", "4,0.7,1.0,-0.3"]
    (tmp_path / "curves.csv").write_text("\n".join(rows))
    assert discriminator_figures(tmp_path / "curves.csv") == pytest.approx({"accuracy": 0.8, "D difference": 1.3})
    assert all(math.isnan(value) for value in discriminator_figures(tmp_path / "none.csv").values())


def test_figures_of_a_run_are_those_of_its_validation(tmp_path):
    (tmp_path / "validation").mkdir()
    found = as_json({"speed error": 0.04, "accuracy": math.nan})
    (tmp_path / "validation" / "figures.json").write_text(json.dumps({"figures": found}, allow_nan=False))
    (tmp_path / "done.json").write_text('{"seconds": 90.0}')
    figures = figures_of(tmp_path, None)
    expected = {"speed error": 0.04, "accuracy": math.nan, "minutes of training": 1.5}
    assert figures == pytest.approx(expected, nan_ok=True)


def test_style_is_measured_from_one_bundle_for_all_arms(tmp_path, root, robot):
    (tmp_path / "validation").mkdir()
    found = {"style distance at 1.0 m/s": 0.0, "speed error": 0.04}
    (tmp_path / "validation" / "figures.json").write_text(json.dumps({"figures": found}))
    (tmp_path / "done.json").write_text('{"seconds": 90.0}')
    shutil.copy(root / SHIPPED, tmp_path / "policy.npz")
    common = small_bundle(tmp_path / "common", root, robot)
    figures = figures_of(tmp_path, common)
    assert figures["speed error"] == 0.04
    measured = style_figures(common, tmp_path / "policy.npz")
    assert {name: figures[name] for name in measured} == pytest.approx(measured, nan_ok=True)
    assert figures["style distance at 1.0 m/s"] != 0.0


def test_a_run_from_another_machine_is_only_validated_on_a_cpu(tmp_path, monkeypatch):
    commands: list[list[str]] = []
    started = lambda command, **_: commands.append(command) or argparse.Namespace(returncode=0)  # noqa: E731
    monkeypatch.setattr("benchmarks.ablation.subprocess.run", started)
    arm = arm_of("a=b,ppo.entropy=0.01,schedule.iterations=900")
    given = argparse.Namespace(iterations=880, device="cpu")
    with pytest.raises(SystemExit, match="is not trained to its end"):
        train(arm, 2, tmp_path, given)
    (tmp_path / "amp").mkdir()
    (tmp_path / "amp" / "done.json").write_text("{}")
    train(arm, 2, tmp_path, given)
    (command,) = commands
    assert command[command.index("--stages") + 1 :] == ["distillation", "amp", "validation", *command[-6:]]
    assert command[-6:] == [text for each in ("schedule.iterations=880", *arm.options) for text in ("--set", each)], (
        "the arm's own come last and count"
    )


def test_bars_are_means_and_ranges_over_seeds_without_those_that_fell(tmp_path):
    found = {"a": [{"style": 0.2}, {"style": 0.4}, {"style": math.nan}], "b": [{"style": math.nan}]}
    one, other = bars_of(found)
    assert one.name == "a: style (0.2 to 0.4, 2 of 3 seeds)" and one.value == pytest.approx(0.3)
    assert other.name == "b: style (fell, 0 of 1 seeds)" and math.isnan(other.value)
    draw(found, tmp_path / "arms.png")
    assert (tmp_path / "arms.png").stat().st_size > 1000
