"""MJCF in MuJoCo, URDF in Pinocchio and our own kinematics describe one robot."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from pipeline.robot import Kinematics, Robot, mujoco_model

Poses = tuple[np.ndarray, np.ndarray, np.ndarray]


class Models:
    """The robot in both libraries, and the way from our values to theirs."""

    def __init__(self, robot: Robot):
        self.robot = robot
        self.mujoco = mujoco_model(robot)
        self.data = mujoco.MjData(self.mujoco)
        self.pin = pin.buildModelFromXML(robot.urdf, pin.JointModelFreeFlyer())
        self.pin_data = self.pin.createData()
        joints = [self.pin.joints[self.pin.getJointId(name)] for name in robot.joint_names]
        self.pin_q = np.array([joint.idx_q for joint in joints])
        self.pin_v = np.array([joint.idx_v for joint in joints])
        self.pin.armature[self.pin_v] = robot.armature

    def set_pose(self, root_pos: np.ndarray, root_quat: np.ndarray, joints: np.ndarray) -> np.ndarray:
        """Put MuJoCo into the pose; Pinocchio's q for it."""
        self.data.qpos[:] = np.concatenate([root_pos, root_quat, joints])
        mujoco.mj_forward(self.mujoco, self.data)
        q = np.zeros(self.pin.nq)
        q[:3], q[3:7], q[self.pin_q] = root_pos, np.roll(root_quat, -1), joints
        return q

    def velocity_map(self) -> np.ndarray:
        """Matrix from MuJoCo's velocities (root linear in the world frame) to Pinocchio's (in the root's)."""
        matrix = np.zeros((self.pin.nv, self.pin.nv))
        matrix[:3, :3] = self.data.xmat[1].reshape(3, 3).T
        matrix[3:6, 3:6] = np.eye(3)
        matrix[self.pin_v, np.arange(6, self.pin.nv)] = 1.0
        return matrix


@pytest.fixture
def models(robot: Robot) -> Models:
    return Models(robot)


def test_poses_of_all_links_agree_to_a_nanometre(models: Models, poses: Poses):
    robot = models.robot
    ours = Kinematics(robot).forward(*poses)
    frames = [models.pin.getFrameId(name, pin.FrameType.BODY) for name in robot.link_names]
    for index, pose in enumerate(zip(*poses, strict=True)):
        q = models.set_pose(*pose)
        pin.framesForwardKinematics(models.pin, models.pin_data, q)
        placed = [models.pin_data.oMf[frame] for frame in frames]
        assert models.data.xpos[1:] == pytest.approx(np.array([place.translation for place in placed]), abs=1e-9)
        assert models.data.xpos[1:] == pytest.approx(ours.pos_w[index], abs=1e-9)
        turned = models.data.xmat[1:].reshape(-1, 3, 3)
        assert turned == pytest.approx(np.array([place.rotation for place in placed]), abs=1e-9)
        dots = np.abs(np.sum(models.data.xquat[1:] * ours.quat_w[index], axis=-1))
        assert dots == pytest.approx(1.0, abs=1e-12)


def test_a_link_alone_is_where_it_is_among_all_links(models: Models, poses: Poses):
    kinematics = Kinematics(models.robot)
    every = kinematics.forward(*poses).pos_w
    for link in range(len(models.robot.link_names)):
        assert kinematics.link_pos_w(*poses, link) == pytest.approx(every[:, link], abs=1e-12)


def test_a_motion_of_no_frames_has_no_poses(robot: Robot, poses: Poses):
    links = len(robot.link_names)
    none = Kinematics(robot).forward(*(values[:0] for values in poses))
    assert none.pos_w.shape == (0, links, 3) and none.quat_w.shape == (0, links, 4)


def test_sites_are_where_the_frames_of_their_names_are(models: Models, poses: Poses):
    robot = models.robot
    kinematics = Kinematics(robot)
    ours = kinematics.site_pos_w(kinematics.forward(*poses), robot.site_names)
    frames = [models.pin.getFrameId(name, pin.FrameType.BODY) for name in robot.site_names]
    for index in range(10):
        q = models.set_pose(*(values[index] for values in poses))
        pin.framesForwardKinematics(models.pin, models.pin_data, q)
        in_mujoco = np.array([models.data.site(name).xpos for name in robot.site_names])
        assert in_mujoco == pytest.approx(ours[index], abs=1e-9)
        in_pinocchio = np.array([models.pin_data.oMf[frame].translation for frame in frames])
        assert in_pinocchio == pytest.approx(ours[index], abs=1e-9)


def test_masses_and_centres_of_mass_agree(models: Models, poses: Poses):
    assert pin.computeTotalMass(models.pin) == pytest.approx(models.robot.total_mass, abs=1e-9)
    assert models.mujoco.body_subtreemass[0] == pytest.approx(models.robot.total_mass, abs=1e-9)
    q = models.set_pose(*(values[0] for values in poses))
    assert models.data.subtree_com[0] == pytest.approx(pin.centerOfMass(models.pin, models.pin_data, q), abs=1e-9)


def test_inertia_matrices_with_armature_agree(models: Models, poses: Poses):
    for index in range(10):
        q = models.set_pose(*(values[index] for values in poses))
        to_pin = models.velocity_map()
        expected = np.zeros((models.mujoco.nv, models.mujoco.nv))
        mujoco.mj_fullM(models.mujoco, models.data, expected)
        upper = np.triu(pin.crba(models.pin, models.pin_data, q))
        inertia = upper + np.triu(upper, 1).T
        assert to_pin.T @ inertia @ to_pin == pytest.approx(expected, abs=1e-6)


def test_gravity_torques_agree(models: Models, poses: Poses):
    for index in range(10):
        q = models.set_pose(*(values[index] for values in poses))
        torques = models.velocity_map().T @ pin.computeGeneralizedGravity(models.pin, models.pin_data, q)
        assert torques == pytest.approx(models.data.qfrc_bias, abs=1e-6)


def test_bias_torques_in_motion_agree(models: Models, poses: Poses):
    """Coriolis and gyroscopic terms see each link's inertia, not only their sum."""
    rng = np.random.default_rng(5)
    q = models.set_pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), poses[2][0])
    to_pin = models.velocity_map()
    joint_vel = np.concatenate([np.zeros(6), rng.normal(size=models.mujoco.nv - 6)])
    models.data.qvel[:] = joint_vel
    mujoco.mj_forward(models.mujoco, models.data)
    bias = pin.nonLinearEffects(models.pin, models.pin_data, q, to_pin @ joint_vel)
    assert to_pin.T @ bias == pytest.approx(models.data.qfrc_bias, abs=1e-6)


def test_limits_of_both_models_are_those_of_the_tables(models: Models):
    robot, v = models.robot, models.pin_v
    assert models.mujoco.jnt_range[1:] == pytest.approx(np.stack([robot.joint_lower, robot.joint_upper], axis=-1))
    assert models.pin.lowerPositionLimit[models.pin_q] == pytest.approx(robot.joint_lower)
    assert models.pin.upperPositionLimit[models.pin_q] == pytest.approx(robot.joint_upper)
    assert models.pin.velocityLimit[v] == pytest.approx(robot.retarget_speed_limit)
    assert models.pin.effortLimit[v] == pytest.approx(robot.torque_limit)
    assert models.mujoco.dof_armature[6:] == pytest.approx(robot.armature)
