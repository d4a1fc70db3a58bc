"""A robot against another model file of it: renamed joints are matched by where they are."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.cli.main import main
from pipeline.robot.load import ROBOTS, read_description
from pipeline.robot_check.compare import compare, match, model_of
from pipeline.robot_import.read import read_model
from tests.factories.maker_models import joint, t1_mjcf, t1_urdf, write


@pytest.fixture(scope="module")
def t1():
    return model_of(read_description(ROBOTS / "t1"))


def renamed(tmp_path: Path, changes: dict[str, dict[str, str]] | None = None) -> Path:
    """The T1's URDF in small letters, `_joint` after each joint, with changed limits."""
    urdf = t1_urdf()
    for name, limits in (changes or {}).items():
        joint(urdf, name).find("limit").attrib.update(limits)  # type: ignore[union-attr]
    for each in urdf.iter("joint"):
        each.set("name", f"{each.get('name').lower()}_joint")  # type: ignore[union-attr]
        for part in ("parent", "child"):
            ref = each.find(part)
            ref.set("link", f"{ref.get('link').lower()}_link")  # type: ignore[union-attr]
    for each in urdf.iter("link"):
        each.set("name", f"{each.get('name').lower()}_link")  # type: ignore[union-attr]
    return write(tmp_path / "new.urdf", urdf)


def test_a_robot_has_no_difference_from_its_own_urdf():
    tables = model_of(read_description(ROBOTS / "t1"), rendered=True)
    assert [each for each in compare(tables, read_model(ROBOTS / "t1" / "t1.urdf")) if each.of_both] == []


def test_renamed_joints_are_matched_one_to_one(t1, tmp_path: Path):
    other = read_model(renamed(tmp_path))
    pairs = match(t1, other)
    assert len(pairs) == 24
    for first, second in pairs.items():
        assert f"{t1.links[first].name.lower()}_link" == other.links[second].name


def test_changed_limits_are_listed_joint_by_joint(t1, tmp_path: Path):
    changes = {"Waist": {"lower": "-1.012", "upper": "1.012"}, "Left_Hip_Roll": {"lower": "-0.363"}}
    found = compare(t1, read_model(renamed(tmp_path, changes)))
    texts = [str(each) for each in found if each.figure in ("lower", "upper")]
    assert texts == [
        "Waist: lower -1.57, there -1.012 rad.",
        "Waist: upper 1.57, there 1.012 rad.",
        "Left_Hip_Roll: lower -0.2, there -0.363 rad.",
    ]
    assert "Left_Knee_Pitch: name Left_Knee_Pitch, there left_knee_pitch_joint." in [str(each) for each in found]


def test_joints_of_one_model_alone_are_listed(t1, tmp_path: Path):
    root = t1_mjcf()
    body = next(each for each in root.iter("body") if each.get("name") == "H2")
    body.remove(body.find("joint"))  # type: ignore[arg-type]
    other = read_model(write(tmp_path / "t1.xml", root))
    assert "Head_pitch: joint stated, there not stated." in [str(each) for each in compare(t1, other)]
    assert "Head_pitch: joint not stated, there stated." in [str(each) for each in compare(other, t1)]


def test_the_command_prints_the_differences(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = renamed(tmp_path, {"Left_Knee_Pitch": {"effort": "130.5"}})
    assert main(["check-robot", str(ROBOTS / "t1"), str(path)]) == 0
    said = capsys.readouterr().out
    assert "robots/t1: no findings" in said
    assert "Left_Knee_Pitch: torque 60, there 130.5 N m." in said
    assert "(it does not state every armature)" in said
    assert "not stated" not in said
