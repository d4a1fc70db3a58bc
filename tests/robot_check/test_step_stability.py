"""`check-robot` says which gains shake; MuJoCo's own simulation of a small disturbance agrees."""

from __future__ import annotations

import dataclasses
import re

import mujoco
import numpy as np
import pytest

from pipeline.physics import PHYSICS_S
from pipeline.robot import Robot, mujoco_model
from pipeline.robot_check.pose_checks import step_stability

ELBOW = "Left_Elbow_Pitch"


def with_damping(robot: Robot, kd: float) -> Robot:
    """The robot with another damping gain of one elbow [N m s/rad]."""
    gains = robot.kd.copy()
    gains[robot.joint_names.index(ELBOW)] = kd
    return dataclasses.replace(robot, kd=gains)


def growth(robot: Robot) -> float:
    """Joint speed at the end over that at the start, from a disturbance of 1e-6 rad/s, without gravity or ground."""
    model = mujoco_model(robot)
    model.opt.timestep, model.opt.gravity[:] = PHYSICS_S, 0.0
    data = mujoco.MjData(model)
    data.qpos[:7], data.qpos[7:] = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0], robot.default_joint_pos
    data.qvel[6 + robot.joint_names.index(ELBOW)] = 1e-6
    for _ in range(40):
        data.qfrc_applied[6:] = robot.kp * (robot.default_joint_pos - data.qpos[7:]) - robot.kd * data.qvel[6:]
        mujoco.mj_step(model, data)
    return float(np.abs(data.qvel[6:]).max()) / 1e-6


@pytest.mark.parametrize(("kd", "shakes"), [(1.0, False), (9.0, False), (15.0, True)])
def test_it_agrees_with_the_simulation(robot: Robot, kd: float, shakes: bool):
    changed = with_damping(robot, kd)
    assert (growth(changed) > 1.0) == shakes
    assert [ELBOW in finding.text for finding in step_stability(changed)] == [True] * shakes


@pytest.mark.parametrize(("kp", "kd"), [(50.0, 15.0), (4000.0, 2.5), (9000.0, 0.5)])
def test_the_gains_that_it_advises_do_not_shake(robot: Robot, kp: float, kd: float):
    joint = robot.joint_names.index(ELBOW)

    def findings(stiffness: float, damping: float) -> list[str]:
        changed = with_damping(robot, damping)
        gains = changed.kp.copy()
        gains[joint] = stiffness
        return [finding.text for finding in step_stability(dataclasses.replace(changed, kp=gains))]

    (text,) = findings(kp, kd)
    found = re.search(r"lower kd to ([\d.e+]+) N m s/rad|lower kp below ([\d.e+]+) N m/rad", text)
    assert found, text
    damping, stiffness = found.groups()
    assert findings(kp, float(damping)) == [] if damping else findings(float(stiffness), 0.0) == []
