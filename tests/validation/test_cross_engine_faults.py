"""Faults planted into what walks in two engines: each is what its name says, and fails a required cell."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline import rotation
from pipeline.deployment import deployment_task
from pipeline.robot import Robot
from pipeline.simulation.plant import PlantState
from pipeline.simulation.sensors import PerfectSensors
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.bars import ValidationSettings
from pipeline.validation.cross_engine import cross_engine
from pipeline.validation.cross_engine_walk import DART, MUJOCO, CrossEngineSettings
from pipeline.validation.deployed import Deployed
from tests.factories.cross_engine_faults import FAULTS, with_normalizer
from tests.factories.policies import random_policy


@pytest.fixture(scope="module")
def one_seed(settings: CrossEngineSettings) -> CrossEngineSettings:
    """The grid walked once."""
    return dataclasses.replace(settings, simulation=dataclasses.replace(settings.simulation, seeds=1))


def test_a_gyro_in_the_world_frame_is_right_only_when_facing_x(still: Deployed):
    turned = state_of(rotation.about_z(np.pi / 2.0), [0.3, 0.0, 0.1])
    read_so = FAULTS["gyro in the world frame"](still).reads.read(turned)
    np.testing.assert_allclose(read_so.gyro_b, [0.0, 0.3, 0.1], atol=1e-12)
    ahead = state_of(rotation.IDENTITY.copy(), [0.3, 0.0, 0.1])
    clean = PerfectSensors().read(ahead)
    np.testing.assert_array_equal(FAULTS["gyro in the world frame"](still).reads.read(ahead).gyro_b, clean.gyro_b)
    np.testing.assert_allclose(FAULTS["gyro in deg/s"](still).reads.read(ahead).gyro_b, np.degrees(clean.gyro_b))


def test_faults_of_order_permute_what_they_say(robot: Robot):
    rng = np.random.default_rng(0)
    task = deployment_task(robot)
    clean = Deployed(
        robot=robot, task=task, policy=random_policy(task, rng), envelope=TorqueEnvelope(limit=robot.torque_limit)
    )
    observation = rng.normal(size=(task.history, task.frame_size))
    backwards = FAULTS["reversed history"](clean).policy
    np.testing.assert_allclose(backwards.act(observation.ravel()), clean.policy.act(observation[::-1].ravel()))
    hardware = FAULTS["wrong joint order"](clean).task.policy_joints
    assert sorted(hardware) == sorted(task.policy_joints) and hardware != task.policy_joints
    swapped = FAULTS["left and right swapped"](clean).task
    left, right = (task.policy_joints.index(f"{side}_Knee_Pitch") for side in ("Left", "Right"))
    assert swapped.policy_index[left] == task.policy_index[right]


def test_faults_of_strength_scale_what_they_say(still: Deployed):
    np.testing.assert_allclose(FAULTS["60 % torque"](still).envelope.limit, 0.6 * still.envelope.limit)
    np.testing.assert_allclose(FAULTS["half Kp"](still).motors().kp, 0.5 * still.motors().kp)
    assert FAULTS["action scale halved"](still).task.action_scale == 0.5 * still.task.action_scale
    bare = FAULTS["normalizer left out"](still).policy
    assert not bare.mean.any() and (bare.scale == 1.0).all()


@pytest.mark.shared
@pytest.mark.parametrize(("fault", "cell"), [("60 % torque", "walk_1.0"), ("half Kp", "stand")])
def test_weak_motors_pass_mujoco_and_fall_in_dart(
    published: Deployed, one_seed: CrossEngineSettings, rules: ValidationSettings, fault: str, cell: str
):
    """What the second engine is for."""
    result = cross_engine(FAULTS[fault](published), one_seed, rules, only=(cell,), engines=(MUJOCO, DART))
    assert result.cells[0].survival(MUJOCO) == 1.0
    assert result.cells[0].survival(DART) == 0.0
    assert not result.passed


@pytest.mark.shared
@pytest.mark.parametrize(
    ("fault", "cell"),
    [
        ("gyro in the world frame", "turn_left"),
        ("gyro in deg/s", "stand"),
        ("left and right swapped", "walk_0.6"),
        ("reversed history", "walk_0.6"),
        ("wrong joint order", "stand"),
        ("action scale halved", "walk_0.6"),
    ],
)
def test_planted_faults_fail_a_required_cell(
    published: Deployed, one_seed: CrossEngineSettings, rules: ValidationSettings, fault: str, cell: str
):
    result = cross_engine(FAULTS[fault](published), one_seed, rules, only=(cell,), engines=(MUJOCO, DART))
    assert not result.passed
    assert any(f"cell '{cell}'" in reason for reason in result.reasons)


@pytest.mark.shared
def test_a_normalizer_left_out_fails_where_there_was_one(
    published: Deployed, one_seed: CrossEngineSettings, rules: ValidationSettings
):
    """The published policy has none; given one, it is the same function, and without it another."""
    rng = np.random.default_rng(0)
    size = published.policy.observation_size
    policy = with_normalizer(published.policy, rng.normal(0.0, 0.3, size), rng.uniform(0.3, 3.0, size))
    observation = rng.normal(size=size)
    np.testing.assert_allclose(policy.act(observation), published.policy.act(observation), atol=1e-9)
    fault = FAULTS["normalizer left out"](dataclasses.replace(published, policy=policy))
    assert not cross_engine(fault, one_seed, rules, only=("walk_0.6",), engines=(MUJOCO, DART)).passed


@pytest.mark.shared
def test_a_gyro_in_the_world_frame_passes_straight_on(
    published: Deployed, one_seed: CrossEngineSettings, rules: ValidationSettings
):
    """From a start that faces x: why the grid turns."""
    fault = FAULTS["gyro in the world frame"](published)
    assert cross_engine(fault, one_seed, rules, only=("walk_0.6",), engines=(MUJOCO, DART)).passed


def state_of(quat_w: np.ndarray, ang_vel_b: list[float]) -> PlantState:
    return PlantState(
        root_pos_w=np.zeros(3),
        root_quat_w=quat_w,
        root_lin_vel_w=np.zeros(3),
        root_ang_vel_b=np.array(ang_vel_b),
        joint_pos=np.zeros(23),
        joint_vel=np.zeros(23),
    )
