"""Every planted mistake of a robot folder is found and named; the shipped folders have none."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from pipeline.cli.main import main
from pipeline.robot import render
from pipeline.robot.load import ROBOTS, robot_names
from pipeline.robot_check.check import check_folder
from tests.factories.robot_mistakes import MISTAKES


@pytest.mark.parametrize("name", robot_names())
def test_a_shipped_folder_has_no_finding(name: str):
    assert check_folder(ROBOTS / name) == []


@pytest.mark.parametrize("name", MISTAKES)
def test_a_planted_mistake_is_found_and_named(tmp_path: Path, name: str):
    mistake = MISTAKES[name]
    folder = tmp_path / "t1"
    shutil.copytree(ROBOTS / "t1", folder, ignore=shutil.ignore_patterns("policies", "validation.yaml"))
    mistake.plant(folder)
    if mistake.rendered:
        assert render.main([str(folder)]) == 0
    found = check_folder(folder)
    assert any(each.code == mistake.code and mistake.names in each.text for each in found), [
        str(each) for each in found
    ]


def test_the_command_lists_findings_and_ends_with_three(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    folder = tmp_path / "t1"
    shutil.copytree(ROBOTS / "t1", folder, ignore=shutil.ignore_patterns("policies"))
    MISTAKES["a URDF that was edited"].plant(folder)
    assert main(["check-robot", str(folder)]) == 3
    said = capsys.readouterr().out
    assert "t1.urdf differs from the tables: Left_Knee_Pitch: upper 2.1817, there 2.4 rad." in said
    assert said.endswith("1 finding\n")


def test_a_folder_that_is_not_there_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["check-robot", str(tmp_path / "none")]) == 1
    assert "there is no such robot folder" in capsys.readouterr().err
