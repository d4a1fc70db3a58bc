"""A rollout against mechanics: start velocities, moments about the centre of mass, delays, directions of pushes."""

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.feasibility.torque_criteria import centre_of_mass
from pipeline.physics import GRAVITY, PHYSICS_S
from pipeline.robot import Kinematics, Robot
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.tracking.disturbance import NONE, Disturbance, draw
from pipeline.tracking.process import Setup, process
from pipeline.tracking.rollout import Plant, _Record, _World
from pipeline.tracking.settings import TrackingSettings
from pipeline.tracking.task import DECIMATION
from pipeline.tracking.tracker import load_tracker
from tests.factories.robot_clips import standing, wandering


def world(robot: Robot, shipped: Path, clip: RobotClip, disturbance: Disturbance = NONE) -> _World:
    plant = Plant(robot=robot, envelope=TorqueEnvelope(limit=robot.torque_limit))
    return _World(clip, plant, load_tracker(shipped, robot), disturbance)


def test_the_velocity_of_a_start_leads_to_the_frames_beside_it(robot: Robot, shipped: Path):
    clip = wandering(robot)
    angle = 0.4 + 0.2 * np.sin(np.arange(clip.frame_count) / 10.0)
    tilt = rotation.from_axis_angle(np.array([1.0, 0.0, 0.0]), angle)
    clip = dataclasses.replace(clip, root_quat_w=rotation.multiply(clip.root_quat_w, tilt))
    one = world(robot, shipped, clip)
    one._place(30, None)
    start = one._data.qpos.copy()
    for step, frame in ((-1, 29), (1, 31)):
        there = start.copy()
        mujoco.mj_integratePos(one._model, there, one._data.qvel, step / clip.fps)
        np.testing.assert_allclose(there[:3], clip.root_pos_w[frame], atol=2e-3)
        assert rotation.angle_between(there[3:7], clip.root_quat_w[frame]) < 1e-3
        np.testing.assert_allclose(there[7:], clip.joint_pos[frame], atol=5e-3)


def test_contact_wrenches_of_a_robot_that_stands_have_no_moment_about_its_centre_of_mass(
    robot: Robot, values: TrackingSettings, shipped: Path
):
    envelope = TorqueEnvelope(limit=robot.torque_limit)
    setup = Setup(settings=values.nominal(), robot=robot, envelope=envelope, tracker=shipped)
    clip = process(standing(robot, seconds=3.0), {"variant": "original"}, setup=setup).pieces[0].clip
    assert isinstance(clip, RobotClip) and clip.forces is not None
    poses = Kinematics(robot).forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    feet = [int(robot.tree.site_link[robot.site(name)]) for name in robot.feet]
    com = centre_of_mass(robot, clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    force, moment = clip.forces.foot_wrench_w[..., :3], clip.forces.foot_wrench_w[..., 3:]
    about_com = (np.cross(poses.pos_w[:, feet] - com[:, None], force) + moment).sum(axis=1)
    assert np.abs(about_com[50:-5].mean(axis=0)).max() < 0.5, "N m, of a robot of 310 N"


@pytest.mark.parametrize("late", range(3))
def test_a_delayed_target_acts_after_as_many_steps_of_physics(
    robot: Robot, shipped: Path, monkeypatch: pytest.MonkeyPatch, late: int
):
    one, aims, joints = (
        world(robot, shipped, standing(robot), Disturbance(delay_steps=late)),
        [],
        len(robot.joint_names),
    )
    one._place(0, None)

    def torque(self, aim, *_):
        aims.append(float(aim[0]))
        return np.zeros(len(aim))

    monkeypatch.setattr(type(one._motors), "torque", torque)
    one._step(0, np.ones(joints), np.zeros(joints), _Record(2, joints, one._model.nbody, one._feet))
    assert aims == [0.0] * late + [1.0] * (4 - late)


def test_pushes_come_from_all_directions_alike(values: TrackingSettings):
    found = [draw(values.disturbance, 10.0, np.random.default_rng(seed)) for seed in range(200)]
    forces = np.array([push.force_w for each in found for push in each.pushes])
    covariance = np.cov(forces[:, :2].T)
    assert 0.8 < covariance[0, 0] / covariance[1, 1] < 1.25 and (forces[:, 2] == 0.0).all()


def test_every_disturbance_is_drawn_from_all_of_its_range(values: TrackingSettings):
    """A tenth at an end of a range is missed by 200 draws with a probability of 1e-9."""
    ranges = values.disturbance
    drawn = [draw(ranges, 10.0, np.random.default_rng(seed)) for seed in range(200)]
    for name, (low, high) in {
        "friction": ranges.friction,
        "trunk_mass": ranges.trunk_mass,
        "kp": ranges.gains,
        "kd": ranges.gains,
        "action_noise": ranges.action_noise,
    }.items():
        found, edge = [getattr(each, name) for each in drawn], 0.1 * (high - low)
        assert low <= min(found) < low + edge and high - edge < max(found) <= high, name
    assert {each.delay_steps * PHYSICS_S for each in drawn} == {0.0, PHYSICS_S, 2.0 * PHYSICS_S}
    assert abs(np.corrcoef([each.kp for each in drawn], [each.kd for each in drawn])[0, 1]) < 0.3


def test_a_disturbed_robot_has_other_gains_mass_and_friction(robot: Robot, shipped: Path):
    clip = standing(robot, seconds=0.5)
    usual = world(robot, shipped, clip)
    one = world(robot, shipped, clip, Disturbance(kp=1.1, kd=0.9, trunk_mass=1.05, friction=0.6))
    np.testing.assert_allclose(one._motors.kp, 1.1 * robot.kp)
    np.testing.assert_allclose(one._motors.kd, 0.9 * robot.kd)
    mass = one._model.body_mass / np.maximum(usual._model.body_mass, 1e-9)
    np.testing.assert_allclose(mass[1:], [1.05] + [1.0] * (len(mass) - 2))
    assert {0.6} <= set(one._model.geom_friction[:, 0]) and 1.0 not in one._model.geom_friction[:, 0]


def test_a_foot_that_bears_a_fifth_of_the_weight_is_in_contact(robot: Robot, shipped: Path):
    one, weight = world(robot, shipped, standing(robot, seconds=0.5)), GRAVITY * robot.total_mass
    record = _Record(2, len(robot.joint_names), one._model.nbody, one._feet)
    for left, right in ((0.2, 0.05), (0.05, 0.2)):
        record.state(one._data)
        record._contact[one._feet, 5] = DECIMATION * weight * np.array([left, right])
        record.end_of_step(np.zeros(3))
    record.state(one._data)
    found = one._recorded(record, 0).contacts
    assert found is not None
    assert found[:2].tolist() == [[True, False], [False, True]]
