"""A walk in simulation beside a trial: what is said of its velocity."""

import numpy as np
import pytest

from pipeline import rotation
from pipeline.feedback.sim_to_real import velocity_of
from pipeline.robot import Robot
from pipeline.simulation.record import Rollout


def test_a_robot_that_leans_turns_as_fast_as_its_heading_and_not_as_its_trunks_axis(robot: Robot):
    """.5 m/s ahead on a curve of .8 rad/s, the trunk leaning forward by .5 rad: about its own axis it turns slower."""
    count, step_s, rate, lean = 2000, 0.002, 0.8, 0.5
    time_s, joints = np.arange(count) * step_s, len(robot.joint_names)
    quat = rotation.multiply(
        rotation.from_rotvec(rate * time_s[:, None] * np.array([0.0, 0.0, 1.0])),
        rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), lean),
    )
    qpos = np.zeros((count, 7 + joints))
    qpos[:, 0], qpos[:, 1] = 0.5 / rate * np.sin(rate * time_s), 0.5 / rate * (1.0 - np.cos(rate * time_s))
    qpos[:, 2], qpos[:, 3:7] = 0.6, quat
    qvel = np.zeros((count, 6 + joints))
    qvel[:, 3:6] = rotation.rotate_inverse(quat, np.array([0.0, 0.0, rate]))
    ticks = count // 10
    rollout = Rollout(
        robot=robot,
        timestep_s=step_s,
        qpos=qpos,
        qvel=qvel,
        torque=np.zeros((count, joints)),
        foot_wrench_w=np.zeros((count, 2, 6)),
        command=np.zeros((ticks, 3)),
        target=np.zeros((ticks, joints)),
        action=np.zeros((ticks, 1)),
        fell_s=None,
    )
    assert qvel[0, 5] == pytest.approx(rate * np.cos(lean))
    assert velocity_of(rollout, 1.0, 3.0) == pytest.approx((0.5, 0.0, rate), abs=1e-3)
