"""The T1 as its maker writes it since 2026: differences joint by joint, and motions under the newer names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.cli.main import main
from pipeline.robot.load import ROBOTS, read_description
from pipeline.robot_check.compare import compare, model_of
from pipeline.robot_import.propose import propose
from pipeline.robot_import.read import read_model
from tests.factories.booster_2026 import CHANGES, NAMING, joint_names, newer_mjcf, newer_urdf


@pytest.fixture(scope="module")
def t1():
    return model_of(read_description(ROBOTS / "t1"))


def test_the_command_lists_every_changed_joint_of_the_newer_urdf(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = newer_urdf(tmp_path / "T1_23dof.urdf")
    assert main(["check-robot", str(ROBOTS / "t1"), str(path)]) == 0
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    limits = [line for line in lines if any(f": {each} " in line for each in ("lower", "upper", "torque"))]
    assert sorted(limits) == sorted(CHANGES)
    for own, newer in joint_names().items():
        assert f"{own}: name {own}, there {newer}." in lines


def test_nothing_but_names_and_the_changed_limits_differs(t1, tmp_path: Path):
    found = compare(t1, read_model(newer_urdf(tmp_path / "T1_23dof.urdf")))
    renamed = {each.name for each in found if each.figure == "name"}
    assert set(joint_names()) <= renamed
    others = [str(each) for each in found if each.of_both and each.figure not in ("name", "link's name")]
    assert sorted(others) == sorted(CHANGES)


def test_changed_armatures_of_an_mjcf_are_listed(t1, tmp_path: Path):
    path = newer_mjcf(tmp_path / "T1_23dof.xml", {"Left_Knee_Pitch": "0.07", "Right_Knee_Pitch": "0.07"})
    found = [str(each) for each in compare(t1, read_model(path)) if each.figure == "armature"]
    assert found == [
        "Left_Knee_Pitch: armature 0.063601, there 0.07 kg m^2.",
        "Right_Knee_Pitch: armature 0.063601, there 0.07 kg m^2.",
    ]


def test_a_robot_imported_from_the_newer_file_has_its_names_and_the_t1s_mirror(tmp_path: Path, t1):
    proposal = propose(read_model(newer_urdf(tmp_path / "T1_23dof.urdf")), "t1_2026")
    joints = [row.joint for row in proposal.description.joints]
    assert joints == list(joint_names().values())
    assert proposal.description.config.root_link == "trunk"
    assert proposal.description.config.key_links[0] == "trunk"


def test_a_motion_exported_under_the_newer_names_is_the_same_motion_when_read(
    tmp_path: Path, root: Path, monkeypatch: pytest.MonkeyPatch
):
    """Through the files of both namings, read as recordings of the T1."""
    from pipeline.cli.chain import Chain
    from pipeline.project import Project
    from pipeline.readers import Statement

    monkeypatch.chdir(root)
    clips = []
    for name, options in (("own.csv", []), ("newer.csv", ["--naming", NAMING])):
        assert main(["retarget", "data/motions/stand.bvh", "--out", str(tmp_path / name), *options]) == 0
        clips.append(Chain(Project(root)).read(tmp_path / name, Statement()).motion.clip)
    own, newer = clips
    assert own.joint_names == newer.joint_names == tuple(joint_names())
    np.testing.assert_array_equal(own.joint_pos, newer.joint_pos)
