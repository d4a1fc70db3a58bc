"""`booster-lab cross-engine`: a still policy stands, and does not walk."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.actuators.standing import read_standing_pose
from pipeline.cli.main import main
from pipeline.deployment import PolicyGains, deployment_task, save_policy
from pipeline.robot import Robot
from tests.factories.policies import still_policy


@pytest.fixture
def still(tmp_path: Path, root: Path, robot: Robot) -> Path:
    """A policy that holds the default pose with the manufacturer's standing gains."""
    pose = read_standing_pose(root / "robots" / "t1", robot)
    assert pose is not None
    gains = PolicyGains(
        joint_names=robot.joint_names, kp=pose.kp, kd=pose.kd, default_joint_pos=robot.default_joint_pos
    )
    path = tmp_path / "still.npz"
    save_policy(path, still_policy(deployment_task(robot), gains=gains))
    return path


def test_the_verdict_is_told_with_every_reason(still: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    told = tmp_path / "told.json"
    arguments = ["--cells", "stand", "walk_0.6", "--seeds", "1", "--workers", "1", "--json", str(told)]
    assert main(["cross-engine", str(still), *arguments]) == 3
    said = capsys.readouterr().out
    assert "still.npz on" in said and ": failed" in said
    reasons = json.loads(told.read_text())["reasons"]
    assert reasons and all("'walk_0.6' seed 0" in reason and "for 0.6, 0, off by 0.6" in reason for reason in reasons)
    assert "1 of 2 required cells failed" in said
    assert {reason.split(": ")[0].split(" in ")[1] for reason in reasons} == {"MuJoCo", "DART"}


def test_an_unknown_cell_is_one_sentence(still: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["cross-engine", str(still), "--cells", "walk_9"]) == 1
    assert capsys.readouterr().err.startswith("booster-lab: unknown cell 'walk_9'; there are: arc_left, arc_right")


def test_of_cells_that_are_not_required_nothing_passes(still: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["cross-engine", str(still), "--cells", "right_0.4", "--seeds", "1", "--workers", "1"]) == 3
    said = capsys.readouterr().out
    assert ": failed\n" in said
    assert "not required  right_0.4: the reference " in said
    assert said.endswith("no cell is required: nothing was shown\n")


@pytest.mark.parametrize("module", ["pipeline.cli.policy_commands", "pipeline.viewing.validation_plots"])
def test_what_works_in_mujoco_alone_does_not_load_dart(module: str):
    code = f"import sys; sys.modules['dartpy'] = None; import {module}"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_a_dart_that_can_not_be_loaded_is_one_sentence(
    still: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.delitem(sys.modules, "pipeline.dart.plant", raising=False)
    monkeypatch.setitem(sys.modules, "dartpy", None)
    assert main(["cross-engine", str(still), "--cells", "stand", "--seeds", "1", "--workers", "1"]) == 1
    said = capsys.readouterr().err
    assert "walks in DART need the package dartpy, which can't be loaded (import of dartpy halted" in said
    assert "apt install libgl1 libx11-6" in said
