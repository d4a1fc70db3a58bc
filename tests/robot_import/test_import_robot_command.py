"""`booster-lab import-robot` as a user runs it."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.cli.main import main
from pipeline.robot import load_robot
from pipeline.robot_import.propose import propose, propose_pairs
from pipeline.robot_import.read import read_model
from pipeline.robot_import.write import write_folder
from tests.factories.maker_models import T1


def test_the_folder_loads_and_what_is_open_is_listed(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["import-robot", str(T1 / "t1.urdf"), "--name", "t2", "--out", str(tmp_path / "t2")]) == 0
    said = capsys.readouterr().out
    robot = load_robot(tmp_path / "t2")
    assert (robot.name, len(robot.joint_names)) == ("t2", 23)
    assert "to state: joints.csv, kp: the file has no gains" in said
    assert f"python -m pipeline.robot.render {tmp_path / 't2'}" in said
    readme = (tmp_path / "t2" / "README.md").read_text()
    assert "| shapes | `t1.urdf`, primitives in place of meshes |" in readme
    assert "joints.csv, kp: the file has no gains" in readme
    assert sorted(path.name for path in tmp_path.iterdir()) == ["t2"]


def test_a_stated_table_stands_in_the_readme(tmp_path: Path):
    (tmp_path / "gains.csv").write_text("joint,kp\nWaist,200\n")
    arguments = ["--joints", str(tmp_path / "gains.csv"), "--shapes", str(T1 / "t1.xml"), "--out", str(tmp_path / "t2")]
    assert main(["import-robot", str(T1 / "t1.urdf"), "--name", "t2", *arguments]) == 0
    readme = (tmp_path / "t2" / "README.md").read_text()
    assert "| joints: `kp` | `gains.csv` |" in readme
    assert "| shapes | `t1.xml`, primitives in place of meshes |" in readme


def test_the_name_of_the_makers_file_is_text_in_the_readme(tmp_path: Path):
    named = tmp_path / "a`<img src=x onerror=b>.urdf"
    named.write_text((T1 / "t1.urdf").read_text())
    assert main(["import-robot", str(named), "--name", "t2", "--out", str(tmp_path / "t2")]) == 0
    readme = (tmp_path / "t2" / "README.md").read_text()
    assert "<img" not in readme and "`a'&lt;img src=x onerror=b&gt;.urdf`" in readme


def test_an_existing_folder_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "t2").mkdir()
    (tmp_path / "t2" / "mine.txt").write_text("mine")
    assert main(["import-robot", str(T1 / "t1.urdf"), "--name", "t2", "--out", str(tmp_path / "t2")]) == 1
    assert "it exists already" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "t2").iterdir()] == ["mine.txt"]


@pytest.mark.parametrize("name", ["../t2", "T2", "2t", "a b"])
def test_a_name_that_is_no_name_is_refused(tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]):
    assert main(["import-robot", str(T1 / "t1.urdf"), "--name", name, "--out", str(tmp_path / "t2")]) == 1
    assert "use lower-case letters" in capsys.readouterr().err


def test_nothing_is_left_of_a_folder_that_could_not_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    proposal = propose(read_model(T1 / "t1.urdf"), "t2")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pipeline.robot_import.write.write_robot_folder", full)
    with pytest.raises(OSError, match="No space"):
        write_folder(tmp_path / "t2", proposal, "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("names", "pairs"),
    [
        ([("AL1", "AR1"), ("AL2", "AR2")], (("AL", "AR"),)),
        ([("Left_Hip", "Right_Hip"), ("ALeft_Arm", "ARight_Arm")], (("Left", "Right"),)),
        ([("l_knee", "r_knee"), ("leg_l_1", "leg_r_1")], (("l_", "r_"),)),
        ([("knee_l", "knee_r")], (("_l", "_r"),)),
        ([("waist", "waist")], ()),
    ],
)
def test_pairs_of_names_are_what_left_and_right_differ_by(names: list, pairs: tuple):
    assert propose_pairs(names) == pairs
