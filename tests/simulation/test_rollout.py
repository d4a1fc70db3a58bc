"""The published policy in MuJoCo against published figures; PD and envelope on paper; overlaps."""

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest

from pipeline.quality.planar_motion import command_velocity
from pipeline.robot import Robot
from pipeline.robot.kinematics import mujoco_model
from pipeline.simulation.mujoco_plant import _COLLISION, self_collision
from pipeline.simulation.torque_envelope import PdControl, TorqueEnvelope
from tests.factories.policy_walks import policy_walk
from tests.factories.robot_clips import standing


@pytest.mark.shared
@pytest.mark.parametrize(
    ("command", "reached"), [((1.0, 0.0, 0.0), 0.92), ((2.0, 0.0, 0.0), 1.77), ((-0.6, 0.0, 0.0), -0.54)]
)
def test_the_policy_walks_as_fast_as_published(
    robot: Robot, policies: Path, command: tuple[float, float, float], reached: float
):
    walk = policy_walk(policies, robot, command, 7.0)
    clip = walk.clip("walk", start_s=3.0)
    assert not walk.fell
    assert command_velocity(clip.root_pos_w, clip.root_quat_w, clip.fps).forward_m_s == pytest.approx(reached, abs=0.1)
    assert np.all(np.abs(walk.torque) <= robot.torque_limit)
    vertical = walk.foot_wrench_w[600:, :, 2].sum(axis=1).mean()
    assert vertical == pytest.approx(robot.total_mass * 9.81, rel=0.02)


def test_pd_torque_is_cut_to_the_envelope():
    control = PdControl(
        kp=np.array([100.0, 100.0]), kd=np.array([2.0, 2.0]), envelope=TorqueEnvelope(limit=np.array([30.0, 30.0]))
    )
    torque = control.torque(np.array([0.1, 1.0]), np.zeros(2), np.array([1.0, 0.0]))
    np.testing.assert_allclose(torque, [8.0, 30.0])


def test_torque_falls_from_the_knee_speed_to_the_no_load_speed_when_driving_and_not_when_braking():
    envelope = TorqueEnvelope(limit=np.array([40.0]), knee_speed=np.array([5.0]), no_load_speed=np.array([15.0]))
    speeds = np.array([[0.0], [5.0], [10.0], [15.0], [20.0], [90.0]])
    lower, upper = envelope.bounds(speeds)
    np.testing.assert_allclose(upper[:, 0], [40.0, 40.0, 20.0, 0.0, -20.0, -40.0])
    np.testing.assert_allclose(lower[:, 0], -40.0)


def test_legs_drawn_together_overlap_and_the_default_pose_does_not(robot: Robot):
    clip = standing(robot, 0.1)
    np.testing.assert_array_equal(self_collision(clip, robot).depth, 0.0)
    joints = clip.joint_pos.copy()
    joints[2:, robot.joint("Left_Hip_Roll")] = -0.2
    joints[2:, robot.joint("Right_Hip_Roll")] = 0.2
    found = self_collision(dataclasses.replace(clip, joint_pos=joints), robot)
    np.testing.assert_array_equal(found.depth[:2], 0.0)
    assert np.all(found.depth[2:] > 0.02)
    assert found.pairs[2] is not None
    assert {name.split("_")[0] for name in found.pairs[2]} == {"left", "right"}


def test_shapes_that_collide_with_none_change_no_overlap(robot: Robot):
    clip, rng = standing(robot, 0.5), np.random.default_rng(0)
    joints = rng.uniform(robot.joint_lower, robot.joint_upper, clip.joint_pos.shape)
    found = self_collision(dataclasses.replace(clip, joint_pos=joints), robot)
    model = mujoco_model(robot)
    data = mujoco.MjData(model)
    for frame in range(clip.frame_count):
        data.qpos[:] = np.concatenate([clip.root_pos_w[frame], clip.root_quat_w[frame], joints[frame]])
        mujoco.mj_fwdPosition(model, data)
        assert found.depth[frame] == max(-data.contact.dist.min(initial=0.0), 0.0)
        if found.depth[frame]:
            deepest = data.contact.geom[data.contact.dist.argmin()]
            assert found.pairs[frame] == tuple(model.geom(shape).name for shape in deepest)
    assert (found.depth > 0.0).any()


def test_few_compiled_models_are_kept(robot: Robot):
    clip = standing(robot, 0.1)
    for number in range(8):
        self_collision(clip, dataclasses.replace(robot, mjcf=f"{robot.mjcf}<!-- {number} -->"))
    assert _COLLISION.model.cache_info().currsize == 4
