"""What is asked of `distil`: it is in the run's config, and what can't be meant is told in a sentence."""

from __future__ import annotations

import csv
import json

import pytest
import torch

from pipeline.training import distil
from pipeline.training.distil_request import BATCH
from tests.factories.distil_folder import asked, distil_folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory, root, robot):
    return distil_folder(tmp_path_factory.mktemp("distil"), root, robot)


def test_what_teachers_were_asked_is_in_the_config(folder, tmp_path):
    more = [
        "--walks",
        "other=1:1.1",
        "--both-sides",
        "other",
        "--with-error",
        "other",
        "--clip-joint",
        "Elbow",
        "--iterations",
        "1",
        "--ahead",
        ".5",
        "--rate",
        "2e-4",
        "--under-way",
        ".6",
        "--mirror-role",
        "fast",
        "--teacher",
        f"pushed={folder / 'walks.npz'}",
        "--beyond",
        "other=.05",
    ]
    assert distil.main(asked(folder, tmp_path, *more)) == 0
    config = json.loads((tmp_path / "config.json").read_text(), parse_constant=lambda name: pytest.fail(name))
    assert (config["walks"], config["both_sides"], config["clip_joints"]) == ({"other": "1:1.1"}, ["other"], ["Elbow"])
    assert config["borders"] == {
        "pushed_s": 1.0,
        "turn_rad_s": 1.0,
        "ahead_m_s": 0.5,
        "under_way": 0.6,
        "fast_m_s": 0.85,
        "run_m_s": None,
        "unsteady_deg": None,
    }
    assert config["with_error"] == ["other"]
    assert (config["mirror_roles"], config["beyond"]) == (["fast"], {"other": 0.05})
    with (tmp_path / "curves.csv").open() as file:
        rates = [float(row["learning_rate"]) for row in csv.DictReader(file)]
    assert rates == pytest.approx([2e-4]), "the first of a half cosine"


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--teacher", "walks.npz"], "--teacher is 'walks.npz'; it must be NAME=VALUE"),
        (["--teacher", "behind=walks.npz"], "--teacher names 'behind'; roles are other, ahead, fast, run, sloped,"),
        (["--clip-joint", "Tail"], "--clip-joint is 'Tail', which no joint has in its name"),
        (["--clip-role", "behind"], "--clip-role is 'behind'; roles are other, ahead"),
        (["--mirror-role", "behind"], "--mirror-role is 'behind'; roles are other, ahead"),
        (["--beyond", "other=much"], "--beyond of 'other' is 'much'; it must look like other=.05"),
        (["--beyond", "other=.1"], "--beyond goes away from what --teacher pushed=POLICY does"),
        (["--walks", "other=1.0"], "--walks is '1.0'; it must look like .6:.7,1.0:1.1"),
        (["--walks", "other=1:1,.5:2"], "must grow from pair to pair"),
        (["--walks", "ahead=1:1"], "--walks names 'ahead', which has no --teacher of its own"),
        (["--teacher", "pushed=gone.npz"], "gone.npz: can't be read"),
        (["--teacher", "pushed=robot.xml"], "robot.xml: is no npz of numbers"),
        (["--start-from", "robot.xml"], "robot.xml: is no npz of numbers"),
        (["--memory", str(BATCH - 1)], f"--memory is {BATCH - 1}; it must hold a batch of {BATCH} states"),
        (["--passes", "0"], "--passes is 0; it must be a number over 0"),
        (["--passes", "nan"], "--passes is nan; it must be a number over 0"),
        (["--rate", "0"], "--rate is 0; it must be a number over 0"),
        (["--rate", "inf"], "--rate is inf; it must be a number over 0"),
        (["--ahead", "-1"], "--ahead is -1; it must be 0 or more"),
        (["--preset", "none"], "unknown preset 'none'"),
        (["--set", "hidden"], "--set is 'hidden'; it must be NAME=VALUE"),
        (["--set", "no_such=1"], "no_such"),
        (["--bundle", "nowhere"], "bundle.json: the file is missing"),
        (["--device", "cuda"], "--device is 'cuda', but PyTorch finds no GPU here"),
    ],
)
def test_wrong_requests_are_told_in_a_sentence(folder, tmp_path, monkeypatch, capsys, more, told):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    monkeypatch.chdir(folder / "bundle")
    assert distil.main(asked(folder, tmp_path / "run", *more)) == 2
    error = capsys.readouterr().err
    assert told in error and "Traceback" not in error
    assert not (tmp_path / "run").exists()


def test_a_run_without_a_teacher_for_the_rest_or_in_several_processes_is_refused(folder, tmp_path, monkeypatch, capsys):
    arguments = ["--bundle", str(folder / "bundle"), "--out", str(tmp_path / "run"), "--device", "cpu"]
    arguments += ["--teacher", f"ahead={folder / 'walks.npz'}"]
    assert distil.main(arguments) == 2
    assert "--teacher other=POLICY is needed" in capsys.readouterr().err
    monkeypatch.setenv("WORLD_SIZE", "2")
    assert distil.main(asked(folder, tmp_path / "run")) == 2
    assert "start it without torchrun" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
