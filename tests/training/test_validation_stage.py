"""The last stage of the chain: a checkpoint is chosen and validated; a killed run repeats only one part."""

from __future__ import annotations

import dataclasses
import json
import shutil
import sys

import pytest

from pipeline.deployment import digest as digest_of
from pipeline.deployment import load_policy
from pipeline.export.folder import read_export
from pipeline.files import settings
from pipeline.robot import load_robot
from pipeline.training import validation_stage
from pipeline.training.__main__ import main
from pipeline.training.stage import Stage
from pipeline.validation import sweep as sweep_module
from pipeline.validation.cross_engine import ENGINES
from pipeline.validation.cross_engine_walk import CrossEngineSettings
from pipeline.validation.sweep import SweepResult
from tests.factories.training_bundle import small_bundle

FILES = ("sweep.json", "mujoco.json", "dart.json", "figures.json")


@pytest.fixture(scope="module")
def bundle(tmp_path_factory, root, robot):
    return small_bundle(tmp_path_factory.mktemp("validated"), root, robot, tracker="shipped")


@pytest.fixture(scope="module")
def short():
    """Two commands, one walk and one checkpoint an iteration in place of the whole suite, sweep and grid."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        shorten(monkeypatch)
        yield


@pytest.fixture(scope="module")
def run(bundle, short, tmp_path_factory):
    """A run without a GPU, to its end."""
    out = tmp_path_factory.mktemp("whole") / "run"
    assert main(command(bundle, out)) == 0
    return out


def shorten(monkeypatch):

    def few(cells):
        return tuple(dataclasses.replace(cell, trials=cell.trials[:1]) for cell in cells[2:4])

    whole, sweep, read = validation_stage.cells_of, sweep_module.sweep_cells, settings.read
    monkeypatch.setattr(validation_stage, "cells_of", lambda suite, robot: few(whole(suite, robot)))
    monkeypatch.setattr(sweep_module, "sweep_cells", lambda robot: few(sweep(robot)))

    def grid(path, kind):
        found = read(path, kind)
        if kind is not CrossEngineSettings:
            return found
        one = dataclasses.replace(found.simulation, seeds=1)
        return dataclasses.replace(found, simulation=one, cells={"walk_1.0": found.cells["walk_1.0"]})

    monkeypatch.setattr(settings, "read", grid)
    monkeypatch.setattr("pipeline.training.stage.SAVE_EVERY", 1)


def command(bundle, out, *more: str) -> list[str]:
    sizes = ("simulation.num_envs=8", "distillation.iterations=3")
    given = ["--bundle", str(bundle), "--out", str(out), "--device", "cpu"]
    return [*given, *(text for size in sizes for text in ("--set", size)), *more]


def without_robot(bundle, folder):
    """A copy of a bundle that lacks the robot's folder, and does not state it."""
    shutil.copytree(bundle, folder)
    shutil.rmtree(folder / "adapted_robot")
    about = read(folder / "bundle.json")
    about["files"] = {name: digest for name, digest in about["files"].items() if "/" not in name}
    (folder / "bundle.json").write_text(json.dumps(about))
    return folder


def read(path):
    return json.loads(path.read_text())


def test_a_cpu_run_is_validated_and_gets_a_card_with_its_figures(run, bundle):
    out, found = run, run / "validation"
    sweep, mujoco, dart, figures = (read(found / name) for name in FILES)
    assert [each["iteration"] for each in sweep["checkpoints"]] == [1, 2, 3]
    best = min(sweep["checkpoints"], key=lambda each: (each["score"], -each["iteration"]))
    assert sweep["iteration"] == best["iteration"]
    chosen = found / "checkpoints" / f"model_{sweep['iteration']:06d}.npz"
    assert (out / "policy.npz").read_bytes() == chosen.read_bytes()
    assert mujoco["verdict"]["policy"] == digest_of(load_policy(chosen))
    assert len(mujoco["verdict"]["cells"]) == 2 and len(dart["verdict"]["rows"]) == len(ENGINES)
    assert figures["figures"]["required cells"] == sum(
        each["verdict"] == "passed" for each in mujoco["verdict"]["cells"]
    )
    assert figures["figures"]["accuracy"] is None, "a distilled policy has no discriminator"
    export = read_export(out / "export", load_robot(bundle / "adapted_robot" / "t1"))
    assert export.card.figures == figures
    assert export.card.run["command"] == read(out / "config.json")["command"]
    assert export.card.run["gpu_seconds"] == 0.0 and export.card.run["iterations"] == 3
    assert export.card.data["digest"] == read(bundle / "bundle.json")["database_digest"]
    assert not export.card.shippable


def test_a_run_killed_in_dart_continues_there_with_the_same_card(run, bundle, tmp_path, monkeypatch):
    out, walk = tmp_path / "run", validation_stage.cross_engine

    def dies(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(validation_stage, "cross_engine", dies)
    assert main(command(bundle, out)) == 130
    assert not (out / "done.json").exists() and not (out / "export").exists()
    monkeypatch.setattr(validation_stage, "cross_engine", walk)
    monkeypatch.setattr(Stage, "run", lambda _: pytest.fail("trained again"))
    monkeypatch.setattr(validation_stage, "measure", lambda *_: pytest.fail("measured again"))
    assert main(command(bundle, out)) == 0
    cards = [read(folder / "export" / "card.json") for folder in (run, out)]
    for card in cards:  # times differ, and with them the curves' file and the card's own digest
        del card["sha256"], card["files"]["curves.csv"]
        card["run"] = {
            name: value
            for name, value in card["run"].items()
            if name not in ("seconds", "steps_per_s", "stages", "command")
        }
    assert cards[0] == cards[1]


def test_a_run_validated_elsewhere_keeps_the_device_of_its_training(run, bundle, tmp_path):
    """A run that was trained without validation on another machine, and is validated here."""
    out = tmp_path / "run"
    assert main(command(bundle, out, "--stages", "distillation")) == 0
    config = {**read(out / "config.json"), "device": "NVIDIA H100", "commit": "abc"}
    (out / "config.json").write_text(json.dumps(config))
    assert main(command(bundle, out)) == 0
    made = read(out / "export" / "card.json")["run"]
    assert (made["device"], made["commit"], made["command"]) == ("NVIDIA H100", "abc", config["command"])


def test_a_bundle_rewritten_during_the_run_is_refused(bundle, tmp_path, monkeypatch, capsys):
    own, out, train = tmp_path / "bundle", tmp_path / "run", Stage.run
    shutil.copytree(bundle, own)

    def written_again(stage):
        train(stage)
        about = read(own / "bundle.json")
        (own / "bundle.json").write_text(json.dumps({**about, "database_digest": "another"}))

    monkeypatch.setattr(Stage, "run", written_again)
    assert main(command(own, out)) == 2
    assert "was rewritten after this run began" in capsys.readouterr().err
    assert (out / "distillation" / "done.json").is_file() and not (out / "validation").exists()


def test_validation_alone_is_refused(bundle, tmp_path, capsys):
    assert main(command(bundle, tmp_path / "out", "--stages", "validation")) == 2
    assert "validation alone is not a run" in capsys.readouterr().err


def test_the_latest_checkpoint_with_the_lowest_score_is_chosen():
    found = [
        SweepResult(iteration=1, falls=0, missed=0, command_error=0.10, survival=0.5),
        SweepResult(iteration=2, falls=0, missed=0, command_error=0.05, survival=0.5),
        SweepResult(iteration=3, falls=0, missed=0, command_error=0.05, survival=0.5),
        SweepResult(iteration=4, falls=1, missed=0, command_error=0.01, survival=1.0),
    ]
    assert validation_stage.best(found).iteration == 3


@pytest.mark.parametrize("missing", ["dartpy", "thresholds", "robot", "deployment"])
def test_what_validation_needs_is_missed_before_training(bundle, tmp_path, monkeypatch, capsys, root, missing):
    monkeypatch.setattr(Stage, "run", lambda _: pytest.fail("trained"))
    message = {
        "dartpy": "apt install libgl1 libx11-6). Or leave validation out",
        "thresholds": "validation has no thresholds for this robot. Add it, or leave validation out",
        "robot": "adapted_robot/t1: there is no such folder. Write the bundle again",
        "deployment": "booster_deploy has no configuration of 't1' that is known here. Write the file",
    }[missing]
    if missing == "dartpy":
        monkeypatch.delitem(sys.modules, "pipeline.dart.plant", raising=False)
        monkeypatch.setitem(sys.modules, "dartpy", None)
    elif missing == "deployment":
        monkeypatch.setattr("pipeline.export.booster_deploy.ROBOTS", tmp_path)
    elif missing == "thresholds":
        monkeypatch.setattr(validation_stage, "ROOT", tmp_path)
    else:
        bundle = without_robot(bundle, tmp_path / "bundle")
    assert main(command(bundle, tmp_path / "out")) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
