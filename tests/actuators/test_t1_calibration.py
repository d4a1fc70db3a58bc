"""The shipped sweeps and the T1 that follows from them, against the paper's table and published armatures."""

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pinocchio
import pytest

from pipeline.actuators.adapted_robot import (
    NO_MEASUREMENTS,
    adapt,
    read_actuators,
    torque_envelope,
    write_adapted_robot,
)
from pipeline.actuators.calibrate import Calibration, calibrate
from pipeline.actuators.folder import read_published
from pipeline.actuators.motor_table import read_motors
from pipeline.actuators.standing import read_standing_pose, stand
from pipeline.actuators.synthesize import Curve, Sweep, drives, measurement_text
from pipeline.errors import FileError
from pipeline.files import settings
from pipeline.robot import Robot, load_robot
from tests.factories.sweeps import CURVE, SETTINGS, points, written

PAPER = {
    "waist": (25.0, 12.57),
    "hip_pitch": (45.0, 16.76),
    "hip_roll": (25.0, 12.57),
    "hip_yaw": (25.0, 12.57),
    "knee": (60.0, 12.57),
}
"""The paper's table of limits [N m], [rad/s]."""
ARMATURES = {
    "waist": 0.0478125,
    "hip_pitch": 0.0523908,
    "hip_roll": 0.0478125,
    "hip_yaw": 0.0478125,
    "knee": 0.0636012,
    "ankle_pitch": 0.0679104,
    "ankle_roll": 0.0679104,
    "shoulder_pitch": 0.0282528,
    "elbow_yaw": 0.0282528,
    "head_yaw": 0.0018,
}
"""Published armatures [kg m^2]; an ankle's is that of two rotors."""


@pytest.fixture(scope="module")
def folder(root: Path) -> Path:
    return root / "data/actuators/t1"


@pytest.fixture(scope="module")
def t1_drives(folder: Path) -> dict[str, Curve]:
    return drives(load_robot("t1"), read_motors(folder / "motors.csv", SETTINGS.model), folder / "motors.csv")


@pytest.fixture(scope="module")
def calibrations(folder: Path) -> tuple[Calibration, ...]:
    motors = read_motors(folder / "motors.csv", SETTINGS.model)
    return tuple(
        calibrate((folder / f"{motor.name}.csv").read_text(), f"{motor.name}.csv", motor, SETTINGS) for motor in motors
    )


@pytest.fixture
def adapted(calibrations, robot: Robot, root: Path, tmp_path: Path) -> Robot:
    return write_adapted_robot(tmp_path / "t1", root / "robots/t1", adapt(robot, calibrations, SETTINGS))


def test_each_shipped_knee_is_within_1_5_percent_and_its_interval_holds_the_table(calibrations, t1_drives):
    for found in calibrations:
        drive = t1_drives[found.motor]
        assert found.accepted, found.verdict
        assert found.knee.torque.value == pytest.approx(drive.knee_torque, rel=0.015)
        assert found.knee.speed.value == pytest.approx(drive.knee_speed, rel=0.015)
        assert drive.knee_torque in found.knee.torque and drive.knee_speed in found.knee.speed
        assert found.synthetic


@pytest.mark.parametrize("name", PAPER)
def test_noise_free_curves_give_the_papers_table_to_its_digits(name: str, folder: Path, t1_drives):
    motor = next(each for each in read_motors(folder / "motors.csv", SETTINGS.model) if each.name == name)
    text = measurement_text(name, dataclasses.replace(t1_drives[name], sag=0.0), Sweep(points=60, noise=0.0))
    knee = calibrate(text, f"{name}.csv", motor, SETTINGS).knee
    assert (round(knee.torque.value, 3), round(knee.speed.value, 3)) == PAPER[name]


def test_armatures_are_the_published_ones_exactly(folder: Path):
    found = {motor.name: motor.armature for motor in read_motors(folder / "motors.csv", SETTINGS.model)}
    assert {name: found[name] for name in ARMATURES} == ARMATURES


def test_the_adapted_t1_keeps_limits_that_the_measurement_confirms(adapted: Robot, robot: Robot):
    np.testing.assert_array_equal(adapted.torque_limit, robot.torque_limit)
    np.testing.assert_array_equal(adapted.motor_speed_limit, robot.motor_speed_limit)
    changed = np.flatnonzero(adapted.armature != robot.armature)
    assert [robot.joint_names[index] for index in changed] == ["AAHead_yaw", "Head_pitch"]


def test_a_weaker_motor_changes_both_model_files_and_only_its_joints(calibrations, robot, root, tmp_path):
    weak = dataclasses.replace(CURVE, knee_torque=50.0, knee_speed=11.0)
    motor = next(
        each for each in read_motors(root / "data/actuators/t1/motors.csv", SETTINGS.model) if each.name == "knee"
    )
    found = calibrate(written(*points(curve=weak)), "knee.csv", motor, SETTINGS)
    others = [each for each in calibrations if each.motor != "knee"]
    actuators = adapt(robot, [*others, found], SETTINGS)
    adapted = write_adapted_robot(tmp_path / "t1", root / "robots/t1", actuators)
    knees = [robot.joint("Left_Knee_Pitch"), robot.joint("Right_Knee_Pitch")]
    np.testing.assert_allclose(adapted.torque_limit[knees], 50.0, rtol=0.015)
    np.testing.assert_allclose(adapted.motor_speed_limit[knees], 11.0, rtol=0.015)
    same = [index for index in range(23) if index not in knees]
    np.testing.assert_array_equal(adapted.torque_limit[same], robot.torque_limit[same])
    urdf = pinocchio.buildModelFromXML(adapted.urdf)
    for name in robot.joint_names:
        place, index = urdf.joints[urdf.getJointId(name)].idx_v, robot.joint(name)
        assert urdf.effortLimit[place] == adapted.torque_limit[index]
        assert urdf.velocityLimit[place] == adapted.motor_speed_limit[index]
    compiled = mujoco.MjModel.from_xml_string(adapted.mjcf)
    np.testing.assert_allclose(compiled.dof_armature[6:], adapted.armature)
    assert read_actuators(tmp_path / "t1") == actuators
    assert load_robot(tmp_path / "t1").digest == adapted.digest != robot.digest


def test_without_measurements_the_robot_is_the_nominal_one(robot: Robot, root: Path, tmp_path: Path):
    actuators = adapt(robot, [], SETTINGS)
    assert {each.verdict for each in actuators} == {NO_MEASUREMENTS}
    assert write_adapted_robot(tmp_path / "t1", root / "robots/t1", actuators).digest == robot.digest


def test_a_refused_motor_keeps_the_models_limits_and_says_why(calibrations, robot: Robot):
    motor = next(each for each in calibrations if each.motor == "waist")
    refused = dataclasses.replace(motor, reasons=("no knee: the sweep ends before the fall",))
    waist = adapt(robot, [refused], SETTINGS)[robot.joint("Waist")]
    assert (waist.box_effort_limit, waist.box_velocity_limit) == (25.0, 12.57)
    assert "refused: no knee" in waist.verdict and np.isnan(waist.dc_motor_no_load_speed)


def test_a_knee_that_is_far_off_the_model_is_taken_for_another_unit(calibrations, robot: Robot):
    motor = next(each for each in calibrations if each.motor == "waist")
    speed = dataclasses.replace(motor.knee.speed, value=1.32, low=1.31, high=1.33)
    slow = dataclasses.replace(motor, knee=dataclasses.replace(motor.knee, speed=speed))
    waist = adapt(robot, [slow], SETTINGS)[robot.joint("Waist")]
    assert waist.box_velocity_limit == 12.57
    assert "is it another unit or side?" in waist.verdict


def test_a_joint_that_the_robot_lacks_is_named(calibrations, robot: Robot):
    with pytest.raises(
        FileError, match=r"motors\.csv: motor 'head_yaw' moves the joint 'Tail', which robot 't1' does not"
    ):
        adapt(robot, [dataclasses.replace(calibrations[0], joints=("Tail",))], SETTINGS)


def test_calibrations_survive_json(calibrations):
    import json

    for each in calibrations:
        assert Calibration.from_dict(json.loads(json.dumps(settings.plain(each)))) == each


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("196.3e-6", "196.3", "rotor_inertia is 196.3"),
        (",18,196.3e-6", ",1800,196.3e-6", "gear_ratio is 1800"),
        (",18,196.3e-6", ",1.5,196.3e-6", "the armature that follows is 0.0004"),
        ("196.3e-6", "many", "is no finite decimal number"),
        ("Waist,1", "Left_Knee_Pitch,1", "is moved by 'waist' and 'knee'"),
        ("gear_ratio", "ratio", "columns are not those"),
    ],
)
def test_a_faulty_motor_table_is_refused(folder: Path, tmp_path: Path, old: str, new: str, match: str):
    path = tmp_path / "motors.csv"
    path.write_text((folder / "motors.csv").read_text().replace(old, new))
    with pytest.raises(FileError, match=match):
        read_motors(path, SETTINGS.model)


def test_the_adapted_t1_stands_and_without_its_armatures_it_falls(adapted: Robot, calibrations, robot, root):
    envelope = torque_envelope(adapt(robot, calibrations, SETTINGS))
    pose = read_standing_pose(root / "robots/t1", robot)
    ours = stand(adapted, pose, envelope, adapted.armature)
    assert not ours.fell and ours.seconds == 10.0 and ours.tilt_deg < 1.0
    assert ours.height == pytest.approx(0.685, abs=0.001)
    assert stand(adapted, pose, envelope, np.zeros(23)).fell
    assert stand(adapted, pose, envelope, pose.vendor_armature).fell


def test_the_papers_knees_exceed_the_published_peak_curves(folder: Path, t1_drives):
    """The curves of the motor table are for comparison: all of the paper's corners lie beyond them."""
    curves = read_published(folder)
    motors = read_motors(folder / "motors.csv", SETTINGS.model)
    beyond = {
        motor.name
        for motor in motors
        if t1_drives[motor.name].knee_torque > curves[motor.model].torque(t1_drives[motor.name].knee_speed)
    }
    assert beyond >= set(PAPER)
