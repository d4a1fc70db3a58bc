"""Joints under other names: read by their own, written under either."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest

from pipeline.cli.main import main
from pipeline.clips.robot_clip import RobotClip
from pipeline.deployment.policy import PolicyGains
from pipeline.deployment.task import deployment_task, policy_task
from pipeline.errors import UnknownNameError
from pipeline.export import __main__ as export_command
from pipeline.export.folder import read_export
from pipeline.export.metadata import from_texts
from pipeline.readers.robot_motion import robot_of
from pipeline.robot import Robot, RobotError, load_robot
from pipeline.robot.adapted import write_robot_folder
from pipeline.robot.load import ROBOTS, read_description
from pipeline.robot_check.compare import match, model_of
from tests.factories.policies import still_policy

NAMING = "booster_2026"


def newer(robot: Robot) -> tuple[str, ...]:
    return robot.namings[NAMING]


def test_the_newer_names_of_the_t1_are_those_of_its_maker(t1: Robot):
    names = dict(zip(t1.joint_names, newer(t1), strict=True))
    assert names["Left_Knee_Pitch"] == "left_knee_pitch_joint"
    assert names["Waist"] == "waist_yaw_joint"
    assert len(set(names.values())) == 23


def test_aliases_are_no_part_of_the_robots_digest(tmp_path: Path, t1: Robot):
    shutil.copytree(ROBOTS / "t1", tmp_path / "t1", ignore=shutil.ignore_patterns("policies"))
    (tmp_path / "t1" / "aliases.csv").unlink()
    bare = load_robot(tmp_path / "t1")
    assert bare.digest == t1.digest
    assert bare.namings == {}


def test_an_adapted_folder_keeps_them(tmp_path: Path, t1: Robot):
    adapted = write_robot_folder(tmp_path / "t1", read_description(ROBOTS / "t1"))
    assert adapted.namings == t1.namings


def test_a_recording_under_newer_names_is_read_in_the_robots_order(t1: Robot):
    names = tuple(reversed(newer(t1)))
    robot, columns = robot_of(Path("x.npz"), 23, names)
    assert robot.name == "t1"
    assert columns == list(reversed(range(23)))


def test_names_of_two_namings_in_one_file_are_read(t1: Robot):
    names = (*t1.joint_names[:10], *newer(t1)[10:])
    assert robot_of(Path("x.npz"), 23, names)[1] == list(range(23))


def test_a_retargeted_csv_is_written_in_either_naming_and_read_back(
    tmp_path: Path, root: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(root)
    clips = {}
    for naming in ("", NAMING):
        out = tmp_path / f"walk{naming}.csv"
        options = ["--naming", naming] if naming else []
        assert main(["retarget", "data/motions/stand.bvh", "--out", str(out), *options]) == 0
        header = next(line for line in out.read_text().splitlines() if not line.startswith("#"))
        assert ("left_knee_pitch_joint" in header) == bool(naming)
        assert main(["inspect", str(out)]) == 0
        clips[naming] = out.read_text().splitlines()[-1]
    assert clips[""] == clips[NAMING]


def test_an_unknown_naming_is_told_with_those_there_are(t1: Robot):
    with pytest.raises(UnknownNameError, match=f"unknown naming 'mine'; there are: {NAMING}"):
        t1.in_naming("mine")


def test_a_policy_with_gains_under_newer_names_has_the_same_task(t1: Robot):
    policy = still_policy(deployment_task(t1))
    order = np.random.default_rng(3).permutation(23)
    gains = PolicyGains(
        joint_names=tuple(newer(t1)[index] for index in order),
        kp=np.arange(1.0, 24.0)[order],
        kd=np.ones(23),
        default_joint_pos=t1.default_joint_pos[order],
    )
    task = policy_task(t1, dataclasses.replace(policy, gains=gains))
    assert task.kp.tolist() == list(range(1, 24))
    assert task.joint_names == t1.joint_names


def test_a_policy_is_exported_in_the_newer_naming(tmp_path: Path, t1: Robot):
    import onnx

    shipped = ROBOTS / "t1" / "policies" / "walk"
    for naming, out in (("", tmp_path / "own"), (NAMING, tmp_path / "newer")):
        options = ["--naming", naming] if naming else []
        assert export_command.main([str(shipped), "--robot", "t1", "--out", str(out), *options]) == 0
    facts = {}
    for name in ("own", "newer"):
        model = onnx.load(tmp_path / name / "policy.onnx")
        facts[name] = from_texts({each.key: each.value for each in model.metadata_props})
    assert facts["own"]["joint_names"] == list(t1.joint_names)
    assert facts["newer"]["joint_names"] == list(newer(t1))
    renamed = dict(zip(t1.joint_names, newer(t1), strict=True))
    assert facts["newer"]["policy_joints"] == [renamed[name] for name in facts["own"]["policy_joints"]]
    assert facts["newer"]["kp"] == facts["own"]["kp"]
    task = next((tmp_path / "newer" / "booster_deploy").rglob("*.py")).parent
    text = "".join(path.read_text() for path in task.rglob("*.py"))
    assert '"left_knee_pitch_joint"' in text and "Left_Knee_Pitch" not in text
    assert read_export(tmp_path / "newer", t1).task.joint_names == t1.joint_names


def test_an_archive_of_a_clip_has_the_newer_names(t1: Robot):
    from pipeline.dataset_export.export import ARCHIVES

    named = t1.in_naming(NAMING)
    frames = 5
    clip = RobotClip(
        name="still",
        fps=50.0,
        robot="t1",
        root_pos_w=np.tile([0.0, 0.0, t1.default_root_height], (frames, 1)),
        root_quat_w=np.tile([1.0, 0.0, 0.0, 0.0], (frames, 1)),
        joint_names=named.joint_names,
        joint_pos=np.tile(t1.default_joint_pos, (frames, 1)),
    )
    assert b"left_knee_pitch_joint".decode().encode("utf-32-le") in ARCHIVES["mjlab"](clip, named)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda text: text.replace("joint,", "name,", 1), "the columns are name, booster_2026"),
        (lambda text: text.replace("Waist,", "Waiste,"), "the joints are not those of joints.csv"),
        (
            lambda text: text.replace("waist_yaw_joint", "left_knee_pitch_joint"),
            "stands for 'Left_Knee_Pitch', and for 'Waist'",
        ),
        (lambda text: text.replace("waist_yaw_joint", ""), "'Waist' has no name"),
        (lambda text: text.replace("waist_yaw_joint", "a,b"), "the row has 3 values"),
    ],
)
def test_a_faulty_table_of_aliases_is_refused(tmp_path: Path, change, told: str):
    shutil.copytree(ROBOTS / "t1", tmp_path / "t1", ignore=shutil.ignore_patterns("policies"))
    path = tmp_path / "t1" / "aliases.csv"
    path.write_text(change(path.read_text()))
    with pytest.raises(RobotError, match=told):
        load_robot(tmp_path / "t1")


def test_aliases_stand_where_the_joints_of_the_makers_file_are(tmp_path: Path, t1: Robot):
    """Joints are matched by place between the tables and a file under the newer names."""
    from pipeline.robot_import.read import read_model

    text = (ROBOTS / "t1" / "t1.urdf").read_text()
    for own, other in zip(t1.joint_names, newer(t1), strict=True):
        text = text.replace(f'<joint name="{own}" type="revolute">', f'<joint name="{other}" type="revolute">')
    (tmp_path / "t1.urdf").write_text(text)
    tables, other = model_of(read_description(ROBOTS / "t1")), read_model(tmp_path / "t1.urdf")
    for first, second in match(tables, other).items():
        joints = tables.links[first].joint, other.links[second].joint
        if joints[0] is not None and joints[1] is not None:
            assert t1.own_names([joints[1].name]) == (joints[0].name,)
