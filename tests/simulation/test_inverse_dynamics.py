"""Needed forces against Pinocchio, against formulas, and against the forces of a simulation."""

from pathlib import Path

import numpy as np
import pinocchio
import pytest

from pipeline import rotation
from pipeline.robot import Kinematics, Robot
from pipeline.simulation.inverse_dynamics import StateSeries, motion_forces, states
from tests.factories.policy_walks import policy_walk
from tests.factories.robot_clips import standing


def _random_states(robot: Robot, count: int) -> StateSeries:
    rng = np.random.default_rng(5)
    joints = rng.uniform(robot.joint_lower, robot.joint_upper, (count, len(robot.joint_names)))
    quat = rotation.normalize(rng.normal(size=(count, 4)))
    velocities = rng.normal(size=(2, count, 6 + joints.shape[1]))
    qpos = np.concatenate([rng.normal(size=(count, 3)), quat, joints], axis=1)
    return StateSeries(qpos=qpos, qvel=velocities[0], qacc=velocities[1] * 10.0)


def test_forces_agree_with_the_recursive_newton_euler_of_pinocchio(robot: Robot):
    series = _random_states(robot, 30)
    found = motion_forces(robot, series)
    model = pinocchio.buildModelFromXML(robot.urdf, pinocchio.JointModelFreeFlyer())
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    model.armature = np.zeros(model.nv)
    data = model.createData()
    place = [model.joints[model.getJointId(name)] for name in robot.joint_names]
    for frame in range(30):
        q, v, a = series.qpos[frame], series.qvel[frame], series.qacc[frame]
        quat = q[3:7]
        lin_vel_b, lin_acc_b = rotation.rotate_inverse(quat, v[:3]), rotation.rotate_inverse(quat, a[:3])
        pin_q, pin_v, pin_a = np.zeros(model.nq), np.zeros(model.nv), np.zeros(model.nv)
        pin_q[:7] = [*q[:3], *quat[1:], quat[0]]
        pin_v[:6] = [*lin_vel_b, *v[3:6]]
        pin_a[:6] = [*(lin_acc_b - np.cross(v[3:6], lin_vel_b)), *a[3:6]]
        for index, joint in enumerate(place):
            pin_q[joint.idx_q], pin_v[joint.idx_v], pin_a[joint.idx_v] = q[7 + index], v[6 + index], a[6 + index]
        tau = pinocchio.rnea(model, data, pin_q, pin_v, pin_a)
        wrench_w = np.concatenate([rotation.rotate(quat, tau[:3]), rotation.rotate(quat, tau[3:6])])
        torque = np.array([tau[joint.idx_v] for joint in place]) + robot.armature * a[6:]
        np.testing.assert_allclose(found.root_wrench_w[frame], wrench_w, atol=1e-5)
        np.testing.assert_allclose(found.joint_torque[frame], torque, atol=1e-5)


def test_a_robot_at_rest_needs_its_weight(robot: Robot):
    clip = standing(robot)
    found = motion_forces(robot, states(clip.root_pos_w, clip.root_quat_w, clip.joint_pos, clip.fps, 10.0))
    np.testing.assert_allclose(found.root_wrench_w[:, :3], [[0.0, 0.0, robot.total_mass * 9.81]] * 100, atol=1e-6)


def test_a_robot_in_free_fall_needs_no_force(robot: Robot):
    clip = standing(robot, seconds=1.0)
    times_s = np.arange(clip.frame_count) / clip.fps
    falling = clip.root_pos_w + np.stack(
        [0.5 * times_s, 0.0 * times_s, 2.0 * times_s - 0.5 * 9.81 * times_s**2], axis=1
    )
    found = motion_forces(robot, states(falling, clip.root_quat_w, clip.joint_pos, clip.fps, 1000.0))
    np.testing.assert_allclose(found.root_wrench_w, 0.0, atol=1e-6)
    np.testing.assert_allclose(found.joint_torque, 0.0, atol=1e-6)


def test_states_of_sines_have_the_derivatives_of_sines(robot: Robot):
    times_s = np.arange(0.0, 4.0, 0.02)
    joints = np.tile(np.sin(3.0 * times_s)[:, None], (1, len(robot.joint_names)))
    turn = 0.5 * times_s**2
    root = np.stack([np.cos(2.0 * times_s), times_s, 0.7 + 0.0 * times_s], axis=1)
    series = states(root, rotation.about_z(turn), joints, 50.0, 1000.0)
    inner = slice(2, -2)
    np.testing.assert_allclose(series.qvel[inner, 6], 3.0 * np.cos(3.0 * times_s)[inner], atol=5e-3)
    np.testing.assert_allclose(series.qacc[inner, 6], -9.0 * np.sin(3.0 * times_s)[inner], atol=5e-3)
    np.testing.assert_allclose(series.qacc[inner, 0], -4.0 * np.cos(2.0 * times_s)[inner], atol=5e-3)
    np.testing.assert_allclose(series.qvel[inner, 5], times_s[inner], atol=1e-6)
    np.testing.assert_allclose(series.qacc[inner, 5], 1.0, atol=1e-6)


@pytest.mark.shared
def test_with_the_true_contact_forces_of_a_walk_the_torques_are_the_motors(robot: Robot, policies: Path):
    walk = policy_walk(policies, robot, (1.0, 0.2, 0.3), 2.0)
    assert walk.qacc is not None
    found = motion_forces(robot, StateSeries(qpos=walk.qpos, qvel=walk.qvel, qacc=walk.qacc))
    poses = Kinematics(robot).forward(walk.qpos[:, :3], walk.qpos[:, 3:7], walk.qpos[:, 7:])
    origin_w = poses.pos_w[:, [robot.link("left_foot_link"), robot.link("right_foot_link")]]
    force, moment = walk.foot_wrench_w[:, :, :3], walk.foot_wrench_w[:, :, 3:]
    about_root = moment + np.cross(origin_w - walk.qpos[:, None, :3], force)
    np.testing.assert_allclose(found.root_wrench_w[:, :3], force.sum(axis=1), atol=1e-6)
    np.testing.assert_allclose(found.root_wrench_w[:, 3:], about_root.sum(axis=1), atol=1e-6)
    torque = found.joint_torque.copy()
    for joint, name in enumerate(robot.joint_names):
        for side, prefix in enumerate(("Left", "Right")):
            if name == "Waist" or (name.startswith(prefix) and name.split("_")[1] in ("Hip", "Knee", "Ankle")):
                about = moment[:, side] + np.cross(origin_w[:, side] - found.joint_anchor_w[:, joint], force[:, side])
                torque[:, joint] -= np.sum(found.joint_axis_w[:, joint] * about, axis=1)
    np.testing.assert_allclose(torque, walk.torque, atol=1e-6)
