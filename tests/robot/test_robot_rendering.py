"""MJCF and URDF are rendered from the tables: the committed files are the rendering, byte for byte."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as Xml

import mujoco
import numpy as np
import placo
import pytest

from pipeline.robot import Robot, load_robot, mujoco_model, render
from pipeline.robot.load import ROBOTS, robot_names
from pipeline.robot.model_files import numbers
from tests.factories.robot_folder import copy_robot, replace, write_small_robot


@pytest.mark.parametrize("name", robot_names())
def test_the_committed_model_files_are_the_rendering(name: str, tmp_path: Path):
    folder = copy_robot(ROBOTS / name, tmp_path)
    models = [folder / f"{name}.xml", folder / f"{name}.urdf"]
    for path in models:
        path.unlink()
    assert render.main([str(folder)]) == 0
    for path in models:
        assert path.read_bytes() == (ROBOTS / name / path.name).read_bytes()


@pytest.mark.parametrize(("arguments", "status"), [(["--help"], 0), ([], 2)])
def test_the_usage_is_printed(arguments: list[str], status: int, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as stopped:
        render.main(arguments)
    assert stopped.value.code == status
    assert "usage: python -m pipeline.robot.render" in "".join(capsys.readouterr())


def test_a_changed_number_reaches_both_models_and_the_digest(t1: Robot, t1_folder: Path, tmp_path: Path):
    folder = copy_robot(t1_folder, tmp_path)
    replace(folder / "joints.csv", "Left_Knee_Pitch,yes,0,2.1817,", "Left_Knee_Pitch,yes,0,2.2,")
    assert render.main([str(folder)]) == 0
    changed = load_robot(folder)
    assert changed.digest != t1.digest
    assert mujoco_model(changed).joint("Left_Knee_Pitch").range[1] == 2.2
    assert 'upper="2.2"' in changed.urdf


def test_a_folder_with_a_fault_ends_with_its_message(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    folder = write_small_robot(tmp_path / "small")
    replace(folder / "joints.csv", "l_hip,yes,-1.5,1,", "l_hip,yes,1.5,1,")
    assert render.main([str(folder)]) == 1
    assert "lower limit 1.5 rad is not below the upper limit 1.0 rad" in capsys.readouterr().err


def test_placo_reads_the_urdf_with_its_frames_and_limits(robot: Robot):
    wrapper = placo.RobotWrapper("", placo.Flags.ignore_collisions, robot.urdf)
    assert wrapper.total_mass() == pytest.approx(robot.total_mass)
    assert set(wrapper.joint_names()) >= set(robot.joint_names)
    assert set(wrapper.frame_names()) >= set(robot.site_names) | set(robot.link_names)


def test_a_capsule_covers_the_same_space_in_both_models(tmp_path: Path):
    """URDF knows no capsule: the ends of its stand-in must lie where MuJoCo has the centres of the caps."""
    robot = load_robot(write_small_robot(tmp_path / "small"))
    model = mujoco_model(robot)
    geom = model.geom("l_leg_collision")
    axis = np.zeros(9)
    mujoco.mju_quat2Mat(axis, geom.quat)
    caps = [geom.pos + sign * geom.size[1] * axis.reshape(3, 3)[:, 2] for sign in (1.0, -1.0)]
    parts = {part.get("name"): part for part in Xml.fromstring(robot.urdf).iter("collision")}
    for name, cap in zip(("l_leg_end_a", "l_leg_end_b"), caps, strict=True):
        assert [float(value) for value in parts[name].find("origin").get("xyz").split()] == pytest.approx(cap, abs=1e-9)
        assert float(parts[name].find("geometry/sphere").get("radius")) == geom.size[0]
    cylinder = parts["l_leg"].find("geometry/cylinder")
    assert float(cylinder.get("length")) == pytest.approx(2.0 * geom.size[1])


def test_numbers_are_written_exactly_and_without_a_negative_zero():
    assert numbers([0.1, -0.0, 2.0, -1.42058018e-06]) == "0.1 0 2 -1.42058018e-06"
    assert float(numbers([np.pi])) == np.pi
