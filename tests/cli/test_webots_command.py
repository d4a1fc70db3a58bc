"""`booster-lab webots-project`: the folder that it writes, and what it says of a walk."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pipeline.cli.main import main
from pipeline.deployment import deployment_task, save_policy
from pipeline.robot import Robot
from tests.factories.policies import still_policy


def test_a_project_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["webots-project", "--robot", "t1", "--out", str(tmp_path / "webots")]) == 0
    said = capsys.readouterr().out
    assert "23 motors, 31.7344 kg" in said
    assert f"webots {tmp_path}/webots/worlds/t1.wbt" in said
    assert (tmp_path / "webots" / "protos" / "BoosterT1.proto").is_file()
    assert (tmp_path / "webots" / "controllers" / "booster_lab" / "booster_lab.py").is_file()


def test_an_unknown_robot_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["webots-project", "--robot", "k9", "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err == "booster-lab: unknown robot 'k9'; there are: k1, t1\n"


def test_a_missing_webots_is_said_and_is_no_pass(
    tmp_path: Path, robot: Robot, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    policy = tmp_path / "policy.npz"
    save_policy(policy, still_policy(deployment_task(robot)))
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("WEBOTS_HOME", raising=False)
    told = tmp_path / "told.json"
    arguments = ["--out", str(tmp_path / "webots"), "--policy", str(policy), "--run", "webots", "--json", str(told)]
    assert main(["webots-project", *arguments]) == 3
    said, found = capsys.readouterr().out, json.loads(told.read_text())
    assert "Webots: not run: webots not found" in said
    note = found.pop("note")
    assert (note is None) == ("note: " not in said), "bars of another robot are told in both places"
    assert found == {
        "engine": "Webots",
        "status": "not run: webots not found",
        "reasons": [],
        "result": None,
    }


def test_a_webots_that_breaks_could_not_be_done(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    program = tmp_path / "webots"
    program.write_text("#!/bin/sh\necho no licence\nexit 4\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin:/usr/bin")
    monkeypatch.setenv("DISPLAY", ":0")
    assert main(["webots-project", "--out", str(tmp_path / "project"), "--run", "webots"]) == 1
    said = capsys.readouterr().out
    assert "Webots: failed to run: crashed, it ended with status 4: no licence" in said


def test_files_that_are_not_of_a_project_are_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    mine = tmp_path / "README.md"
    mine.write_text("mine")
    assert main(["webots-project", "--out", str(tmp_path)]) == 1
    assert "README.md: it exists, and the folder has no project" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["README.md"] and mine.read_text() == "mine"
    mine.unlink()
    for _ in range(2):
        assert main(["webots-project", "--out", str(tmp_path)]) == 0
