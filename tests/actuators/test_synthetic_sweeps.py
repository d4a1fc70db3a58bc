"""The sweeps that ship: made from a seed and each robot's nominal limits, and labelled as synthetic everywhere."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from pipeline.actuators.adapted_robot import adapt, motors_source, torque_envelope, write_adapted_robot
from pipeline.actuators.folder import calibrate_folder
from pipeline.actuators.motor_table import read_motors
from pipeline.actuators.standing import read_standing_pose, stand
from pipeline.actuators.synthesize import drives, main
from pipeline.batch import Store
from pipeline.errors import FileError
from pipeline.robot import Robot, load_robot
from tests.factories.sweeps import SETTINGS


def folders(root: Path) -> list[Path]:
    return sorted(path.parent for path in (root / "data/actuators").glob("*/motors.csv"))


@pytest.fixture(scope="module")
def k1() -> Robot:
    return load_robot("k1")


@pytest.fixture(scope="module")
def k1_actuators(k1: Robot, root: Path, tmp_path_factory: pytest.TempPathFactory):
    store = Store(root=tmp_path_factory.mktemp("store"))
    found = calibrate_folder(root / "data/actuators/k1", SETTINGS, "1", store)
    assert found.unused == ()
    return adapt(k1, found.calibrations, SETTINGS)


@pytest.mark.parametrize("name", ["t1", "k1"])
def test_each_shipped_sweep_is_what_its_seed_gives_and_says_so(name: str, root: Path, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(root)
    shipped, made = root / "data/actuators" / name, tmp_path / name
    made.mkdir()
    shutil.copy2(shipped / "motors.csv", made)
    assert main([str(made), "--robot", str(root / "robots" / name)]) == 0
    sweeps = {path.name for path in made.iterdir()} - {"motors.csv"}
    assert sweeps == {path.name for path in shipped.iterdir()} - {"motors.csv", "published_curves.csv"}
    for sweep in sweeps:
        text = (made / sweep).read_text()
        assert text == (shipped / sweep).read_text()
        assert text.startswith("# synthetic: never measured")


def test_each_joint_of_every_robot_with_a_motor_table_has_a_motor(root: Path):
    assert [folder.name for folder in folders(root)] == ["k1", "t1"]
    for folder in folders(root):
        motors = read_motors(folder / "motors.csv", SETTINGS.model)
        named = [joint for motor in motors for joint in motor.joints]
        assert sorted(named) == sorted(load_robot(root / "robots" / folder.name).joint_names)


def test_the_adapted_k1_is_the_nominal_one_with_torque_lines_labelled_synthetic(k1, k1_actuators, root, tmp_path):
    assert {each.verdict for each in k1_actuators} == {"synthetic sweep: torque confirmed, speed confirmed"}
    assert motors_source(k1_actuators) == "22 of 22 joints synthetic sweep, never measured"
    adapted = write_adapted_robot(tmp_path / "k1", root / "robots/k1", k1_actuators)
    for name in ("torque_limit", "motor_speed_limit", "armature", "joint_lower", "joint_upper"):
        np.testing.assert_array_equal(getattr(adapted, name), getattr(k1, name))
    assert "synthetic sweep" in (tmp_path / "k1" / "actuators.csv").read_text()
    ratio = [each.dc_motor_no_load_speed / each.box_velocity_limit for each in k1_actuators]
    np.testing.assert_allclose(ratio, 1.25, rtol=0.03)


def test_the_k1s_armatures_with_known_gears_are_those_of_booster_train(root: Path):
    motors = {each.name: each for each in read_motors(root / "data/actuators/k1/motors.csv", SETTINGS.model)}
    known = {name: each.armature for name, each in motors.items() if each.armature is not None}
    assert known == {
        "hip_pitch": 0.0478125,
        "hip_roll": 0.0339552,
        "hip_yaw": 0.0282528,
        "ankle_pitch": 0.0565056,
        "ankle_roll": 0.0565056,
    }


def test_a_motor_of_unknown_gear_keeps_the_armature_of_the_robots_folder(k1: Robot, k1_actuators):
    knee = k1.joint("Left_Knee_Pitch")
    assert k1_actuators[knee].armature == k1.armature[knee] == 0.095625


def test_the_adapted_k1_stands(k1: Robot, k1_actuators, root: Path):
    pose = read_standing_pose(root / "robots/k1", k1)
    stood = stand(k1, pose, torque_envelope(k1_actuators), k1.armature)
    assert not stood.fell and stood.tilt_deg < 1.0


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        (",25,76.5e-6,", ",25,,", "has one of gear_ratio and rotor_inertia"),
        ("Left_Hip_Yaw Right_Hip_Yaw", "Left_Hip_Yaw Waist", "motors.csv: motor 'hip_yaw' moves the joint 'Waist', "),
        ("Right_Hip_Yaw,1", "AAHead_yaw,1", "is moved by 'head_yaw' and 'hip_yaw'"),
    ],
)
def test_a_faulty_motor_table_ends_the_command(root, tmp_path, monkeypatch, capsys, old, new, match):
    monkeypatch.chdir(root)
    folder = tmp_path / "k1"
    folder.mkdir()
    (folder / "motors.csv").write_text((root / "data/actuators/k1/motors.csv").read_text().replace(old, new))
    assert main([str(folder), "--robot", str(root / "robots/k1")]) == 1
    assert match in capsys.readouterr().err
    assert [path.name for path in folder.iterdir()] == ["motors.csv"]


def test_joints_of_one_motor_with_different_limits_are_refused(k1: Robot, root: Path):
    path = root / "data/actuators/k1/motors.csv"
    motors = read_motors(path, SETTINGS.model)
    knee = next(each for each in motors if each.name == "knee")
    mixed = type(knee)(**{**vars(knee), "joints": ("Left_Knee_Pitch", "Left_Hip_Yaw")})
    with pytest.raises(FileError, match="the joints of motor 'knee' have 2 different limits"):
        drives(k1, [mixed], path)
