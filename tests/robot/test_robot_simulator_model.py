"""The MuJoCo model: nothing in it that a simulation adds itself, and no contact that should not be."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from pipeline.robot import Robot, load_robot, mujoco_model, render
from pipeline.robot.load import robot_names
from tests.factories.robot_folder import replace, write_small_robot


def in_default_pose(robot: Robot, model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[:] = np.concatenate([[0.0, 0.0, robot.default_root_height, 1.0, 0.0, 0.0, 0.0], robot.default_joint_pos])
    mujoco.mj_forward(model, data)
    return data


def test_joints_and_bodies_stand_in_the_order_of_the_robot(robot: Robot):
    model = mujoco_model(robot)
    assert [model.joint(index).name for index in range(1, model.njnt)] == list(robot.joint_names)
    assert model.joint(0).type == mujoco.mjtJoint.mjJNT_FREE
    assert [model.body(index).name for index in range(1, model.nbody)] == list(robot.link_names)


def test_it_has_no_motors_sensors_lights_or_ground(robot: Robot):
    model = mujoco_model(robot)
    assert (model.nu, model.nsensor, model.nlight, model.nmesh) == (0, 0, 0, 0)
    assert mujoco.mjtGeom.mjGEOM_PLANE not in model.geom_type


def test_the_ground_and_the_time_step_are_as_asked_for(robot: Robot):
    model = mujoco_model(robot, ground=True, timestep=0.002)
    assert model.geom("ground").type == mujoco.mjtGeom.mjGEOM_PLANE
    assert model.opt.timestep == 0.002


def test_every_shape_has_a_name(robot: Robot):
    model = mujoco_model(robot)
    for index in range(model.ngeom):
        collides = model.geom_contype[index] > 0
        assert model.geom(index).name.endswith("_collision" if collides else "_visual")


def test_the_default_pose_does_not_touch_itself(robot: Robot):
    assert in_default_pose(robot, mujoco_model(robot)).ncon == 0


@pytest.mark.parametrize("name", robot_names())
def test_the_default_pose_stands_on_both_soles_and_nothing_else(name: str):
    robot = load_robot(name)
    model = mujoco_model(robot, ground=True)
    data = in_default_pose(robot, model)
    data.qpos[2] -= 1e-6  # the height is rounded to the micrometre, up or down
    mujoco.mj_forward(model, data)
    assert np.abs(data.contact.dist).max() < 1e-5
    touching = set(model.geom_bodyid[data.contact.geom.ravel()].tolist())
    assert touching == {0} | {int(model.site(name).bodyid[0]) for name in robot.feet}


def test_the_four_corners_are_the_bottom_of_the_foot(t1: Robot):
    """The sole sites and the foot's box are written in two tables."""
    model = mujoco_model(t1)
    data = in_default_pose(t1, model)
    for side, names in zip(("left", "right"), t1.sole_corners, strict=True):
        box = model.geom(f"{side}_foot_collision").id
        for name in names:
            local = data.geom_xmat[box].reshape(3, 3).T @ (data.site(name).xpos - data.geom_xpos[box])
            assert np.abs(local) == pytest.approx(model.geom_size[box], abs=2e-6)
            assert local[2] < 0.0


def test_excluded_pairs_of_links_never_touch(tmp_path: Path):
    folder = write_small_robot(tmp_path / "small")
    thigh = "l_leg,l_thigh,capsule,both,grey,0,{y},-0.15,0,0.2,0,{radius},"
    replace(folder / "shapes.csv", thigh.format(y="0", radius="0.04"), thigh.format(y="-0.3", radius="0.15"))
    assert render.main([str(folder)]) == 0
    robot = load_robot(folder)
    assert in_default_pose(robot, mujoco_model(robot)).ncon == 0
    replace(folder / "robot.toml", 'contact_excludes = [["l_thigh", "r_thigh"]]', "contact_excludes = []")
    assert render.main([str(folder)]) == 0
    robot = load_robot(folder)
    assert in_default_pose(robot, mujoco_model(robot)).ncon > 0
