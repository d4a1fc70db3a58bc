"""`booster-lab validate`: exit code as the verdict, reasons in words, wrong files in one sentence."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.cli import policy_commands
from pipeline.cli.main import main
from pipeline.deployment import deployment_task, save_policy
from pipeline.files import atomic
from pipeline.robot import Robot, load_robot
from pipeline.validation.bars import Bar, CellBars, ValidationSettings, read_validation
from pipeline.validation.suites import named
from tests.factories.policies import linear_policy, still_policy

CELL = "push force standing 60 Ns"


@pytest.fixture
def still(robot: Robot, tmp_path: Path) -> Path:
    """The npz of a policy that holds the default pose."""
    save_policy(tmp_path / "still.npz", still_policy(deployment_task(robot)))
    return tmp_path / "still.npz"


@pytest.fixture
def one_push(robot: Robot, root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A suite of a single push."""
    monkeypatch.chdir(root)
    monkeypatch.setattr(policy_commands, "cells_of", lambda suite, of: named(of, {CELL: 1}))


def _bars(monkeypatch: pytest.MonkeyPatch, at_least: float) -> None:
    bars = CellBars(required=True, why="", bars={"survival": Bar(unit="share", source="test", at_least=at_least)})

    def read(project, robot: str) -> ValidationSettings:
        robot_file = project.root / "robots" / robot / "validation.yaml"
        found = read_validation(project.root / "data" / "validation.yaml", robot_file)
        return dataclasses.replace(found, cells={CELL: bars})

    monkeypatch.setattr("pipeline.project.Project.validation", read)


@pytest.mark.usefixtures("one_push")
def test_a_policy_that_fails_ends_with_three_and_every_reason(
    still: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    _bars(monkeypatch, 0.5)
    logs = tmp_path / "failures"
    asked = ["validate", str(still), "--json", str(tmp_path / "said.json"), "--failures", str(logs), "--table"]
    assert main(asked) == 3
    said = capsys.readouterr().out
    assert [path.suffix for path in logs.iterdir()] == [".mcap"]
    assert f"failed  {CELL}: survival 0 share, asked is at least 0.5 share" in said
    assert "1 of 1 required cells failed" in said
    found = json.loads((tmp_path / "said.json").read_text())
    assert found["passed"] is False
    assert found["suite"] == "quick"
    assert found["cells"][0]["fell"] == [0]


@pytest.mark.usefixtures("one_push")
def test_a_policy_that_passes_ends_with_zero(
    still: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    _bars(monkeypatch, 0.0)
    assert main(["validate", str(still)]) == 0
    assert capsys.readouterr().out.rstrip().endswith("passed")


@pytest.mark.usefixtures("one_push")
def test_held_out_trials_leave_no_logs_from_which_a_database_would_learn(
    still: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    _bars(monkeypatch, 0.5)
    asked = ["validate", str(still), "--suite", "held-out", "--json", str(tmp_path / "said.json")]
    assert main([*asked, "--failures", str(tmp_path / "failures")]) == 1
    assert "must not influence the next database. Leave out --failures." in capsys.readouterr().err
    assert not (tmp_path / "failures").exists()
    assert main(asked) == 3
    assert json.loads((tmp_path / "said.json").read_text())["suite"] == "held-out"


@pytest.mark.usefixtures("one_push")
def test_what_passes_now_leaves_no_log_of_when_it_failed(
    robot: Robot, still: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """The closed loop went on learning from it. Another policy's logs are refused a place and stay."""
    logs, asked = tmp_path / "logs", ["validate", str(still), "--failures", str(tmp_path / "logs")]
    _bars(monkeypatch, 0.5)
    assert main(asked) == 3
    (log,) = logs.iterdir()
    _bars(monkeypatch, 0.0)
    assert main(asked) == 0
    assert f"removed (from an earlier verdict): {log}\n" in capsys.readouterr().out
    assert list(logs.iterdir()) == []

    _bars(monkeypatch, 0.5)
    assert main(asked) == 3
    before = log.read_bytes()
    task = deployment_task(robot)
    other = linear_policy(
        np.zeros((len(task.policy_joints), task.observation_size)), np.full(len(task.policy_joints), 0.01)
    )
    save_policy(tmp_path / "other.npz", other)
    assert main(["validate", str(tmp_path / "other.npz"), *asked[2:]]) == 1
    assert "it is no log of this policy's validation" in capsys.readouterr().err
    assert log.read_bytes() == before


@pytest.mark.usefixtures("one_push")
def test_the_verdict_says_whose_bars_they_are_and_with_which_gains_it_walked(
    root: Path,
    robot: Robot,
    still: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    """Two dampings of one policy had the same JSON but for the figures, and the plain robot was held silently to the
    adapted robot's bars."""
    _bars(monkeypatch, 0.0)
    monkeypatch.setattr(policy_commands, "robot_folder", lambda project, name: root / "robots" / name)
    own = dict(zip(robot.joint_names, robot.kd.tolist(), strict=True))
    assert own["Left_Ankle_Roll"] != 2.0
    for damping, ankle, said in (
        ((), own["Left_Ankle_Roll"], ""),
        (("--ankle-kd", "2"), 2.0, "ankles damped with 2 N"),
    ):
        assert main(["validate", str(still), "--json", str(tmp_path / "said.json"), *damping]) == 0
        found = json.loads((tmp_path / "said.json").read_text())
        assert {name: each["kd"] for name, each in found["gains"].items()} == {
            name: ankle if "Ankle" in name else kd for name, kd in own.items()
        }
        assert [found["gains"][name]["kp"] for name in robot.joint_names] == robot.kp.tolist()
        assert found["robot"] == robot.digest != found["robot_of_bars"]
        text = capsys.readouterr().out
        assert text.endswith(f"  note  {found['note']}\npassed\n")
        assert said in text.splitlines()[0] and ("damped" in text) == bool(damping)


@pytest.mark.parametrize("kd", ["nan", "inf", "-1"])
def test_a_damping_that_cannot_be_is_one_sentence(
    root: Path, still: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], kd: str
):
    monkeypatch.chdir(root)
    assert main(["validate", str(still), f"--ankle-kd={kd}"]) == 1
    assert (
        capsys.readouterr().err
        == f"booster-lab: the damping of the ankles is {kd} N m s/rad, allowed are numbers from 0 on.\n"
    )


@pytest.mark.parametrize(
    ("name", "match"),
    [
        ("none.npz", "there is no such file"),
        ("nowhere", "there is no such file or folder"),
        ("policy.pt", "it is not an npz file"),
        ("k1.npz", "k1.npz: it does not fit the robot: "),
        ("text.npz", "is not an npz of numbers"),
        ("small.npz", "the policy has 4 observations and 21 actions; robot 't1' takes 720 and 21"),
        ("folder", "it has no policy.npz"),
    ],
)
def test_what_is_no_policy_of_the_robot_is_one_sentence(
    root: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    name: str,
    match: str,
):
    monkeypatch.chdir(root)
    atomic.write_text(tmp_path / "policy.pt", "weights")
    atomic.write_text(tmp_path / "text.npz", "no numbers")
    save_policy(tmp_path / "small.npz", linear_policy(np.zeros((21, 4))))
    (tmp_path / "folder").mkdir()
    save_policy(tmp_path / "k1.npz", still_policy(deployment_task(load_robot("k1"))))
    assert main(["validate", str(tmp_path / name), "--workers", "1"]) == 1
    said = capsys.readouterr().err
    assert match in said
    assert said.count("\n") == 1


def test_an_unknown_robot_is_told(
    root: Path, still: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(root)
    assert main(["validate", str(still), "--robot", "k9"]) == 1
    assert "unknown robot 'k9'" in capsys.readouterr().err
