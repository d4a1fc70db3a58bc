"""Hinges of the MuJoCo stand-in against a rotation about their axis, for bodies whose frames are turned."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from pipeline import rotation
from pipeline.webots.scene_model import Body, Hinge, Primitive, SceneModel
from pipeline.webots.stand_in.mujoco_engine import MujocoEngine

ANCHOR, START = np.array([0.1, -0.2, 0.3]), 0.4
AXIS = rotation.normalize(np.array([0.3, 1.0, -0.5]))
POS, QUAT = np.array([0.15, -0.1, 0.2]), rotation.from_rotvec(np.array([0.7, -0.4, 1.1]))


def scene() -> SceneModel:
    """A root with one link, whose frame is turned against its parent's and away from the hinge."""
    hinge = Hinge(
        anchor=ANCHOR,
        axis=AXIS,
        position=START,
        stops=(-1.5, 1.5),
        motor="joint",
        sensor="joint_sensor",
        max_torque=10.0,
        max_velocity=10.0,
    )
    ball = Primitive(kind="sphere", size=(0.05,), pos=np.zeros(3), quat=rotation.IDENTITY)
    common = {"mass": 1.0, "com": np.zeros(3), "moment": 0.01 * np.eye(3), "shapes": (ball,)}
    root = Body(name="root", parent=-1, pos=np.array([0.0, 0.0, 2.0]), quat=rotation.IDENTITY, hinge=None, **common)
    link = Body(name="link", parent=0, pos=POS, quat=QUAT, hinge=hinge, **common)
    contact = {"friction": 1.0, "bounce": 0.0, "soft_erp": 0.2, "soft_cfm": 1e-5}
    world = {"timestep_ms": 2.0, "gravity": 9.81, "erp": 0.2, "cfm": 1e-5, "imu": {}, "self_collision": False}
    return SceneModel(name="two", controller="booster_lab", bodies=(root, link), **contact, **world)


@pytest.mark.parametrize("angle", [START, -0.8, 1.2])
def test_a_hinge_turns_its_body_about_the_anchor_from_where_it_starts(angle: float):
    engine = MujocoEngine(scene())
    assert engine.joint_pos() == pytest.approx([START])
    engine.data.qpos[7] = angle
    mujoco.mj_kinematics(engine.model, engine.data)
    turn = rotation.from_axis_angle(AXIS, angle - START)
    place = np.array([0.0, 0.0, 2.0]) + ANCHOR + rotation.rotate(turn, POS - ANCHOR)
    np.testing.assert_allclose(engine.data.body("link").xpos, place, atol=1e-9)
    assert rotation.angle_between(engine.data.body("link").xquat, rotation.multiply(turn, QUAT)) < 1e-6


def test_a_torque_about_the_axis_turns_the_body_that_way():
    engine = MujocoEngine(scene())
    for _ in range(5):
        engine.step(np.array([2.0]))
    assert engine.joint_pos()[0] > START
    mujoco.mj_kinematics(engine.model, engine.data)
    turned = rotation.multiply(rotation.conjugate(engine.data.body("root").xquat), engine.data.body("link").xquat)
    about = rotation.to_rotvec(rotation.multiply(turned, rotation.conjugate(QUAT)))
    assert about @ AXIS == pytest.approx(engine.joint_pos()[0] - START, abs=1e-6)
