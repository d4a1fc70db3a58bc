"""Settings of a trial in the walk that they make: friction, armature, delay, terrain; and the span that is measured."""

import dataclasses

import numpy as np
import pytest

from pipeline.deployment import deployment_task
from pipeline.robot import Robot
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.cells import TERRAINS
from pipeline.validation.cross_engine_walk import BRIDGE, DART, ENGINES, MUJOCO, figures_of, make_plant
from pipeline.validation.deployed import Deployed
from pipeline.validation.figures import numbers_of
from pipeline.validation.trial import CommandProfile, Conditions, Trial, VelocityCommand
from pipeline.validation.walk import Worlds, ground_of, walk
from tests.factories.policies import linear_policy
from tests.factories.validation_walks import gliding_rollout

AHEAD = np.array([3.0, 0.0, 0.0])


def braked(still: Deployed, engine: str, friction: float) -> np.ndarray:
    """Force of the ground on feet that slide [N], just after the robot was kicked."""
    plant, torque = make_plant(engine, still, 0.001, friction), np.zeros(len(still.robot.joint_names))
    for _ in range(20):
        plant.step(torque)
    plant.kick(AHEAD)
    plant.step(torque)
    return plant.foot_wrench_w()[:, :3].sum(axis=0)


@pytest.mark.parametrize("friction", [0.2, 0.4])
@pytest.mark.parametrize("engine", ENGINES)
def test_feet_slide_in_each_engine_by_the_friction_of_the_settings(still: Deployed, engine: str, friction: float):
    """DART's method takes the size of the friction pyramid from the normal forces without friction."""
    force = braked(still, engine, friction)
    normal = braked(still, engine, 1e-6)[2] if engine == DART else force[2]
    assert normal > 50.0
    assert -force[0] / normal == pytest.approx(friction, rel=0.05)


def test_the_bridge_alone_has_the_rotors_on_its_links(still: Deployed):
    armature = still.robot.armature
    joints, bridge = (make_plant(engine, still, 0.002, 1.0).model for engine in (MUJOCO, BRIDGE))
    np.testing.assert_allclose(joints.dof_armature[6:], armature)
    assert not bridge.dof_armature.any()
    more = bridge.body_inertia.sum() - joints.body_inertia.sum()
    assert more == pytest.approx(armature.sum(), rel=1e-6), "an inertia about an axis adds as much to the trace"
    other = dataclasses.replace(still, armature=2.0 * armature)
    np.testing.assert_allclose(make_plant(MUJOCO, other, 0.002, 1.0).model.dof_armature[6:], 2.0 * armature)
    moved = make_plant(BRIDGE, other, 0.002, 1.0).model.body_inertia.sum() - joints.body_inertia.sum()
    assert moved == pytest.approx(2.0 * armature.sum(), rel=1e-6)
    assert make_plant(DART, other, 0.005, 1.0).robot.armature == pytest.approx(2.0 * armature)


@pytest.mark.parametrize("delay_ms", [0, 10, 40])
def test_motors_follow_the_target_of_so_long_ago(robot: Robot, delay_ms: int):
    """The law of the motors, from the targets and the states that were recorded."""
    task = deployment_task(robot)
    shape = (len(task.policy_joints), task.observation_size)
    policy = linear_policy(0.01 * np.random.default_rng(3).normal(size=shape))
    envelope = TorqueEnvelope(limit=np.full(len(robot.joint_names), 1e6))
    one = Deployed(robot=robot, task=task, policy=policy, envelope=envelope)
    stand = CommandProfile(commands=(VelocityCommand(),))
    conditions = Conditions(delay_s=delay_ms / 1000.0)
    trial = Trial(seed=1, command=stand, seconds=0.2, measure_s=0.1, conditions=conditions)
    found = walk(Worlds(one), trial, stop_on_fall=False)
    targets = np.repeat(found.target, found.control_steps, axis=0)
    late = round(delay_ms / 1000.0 / found.timestep_s)
    followed = np.concatenate([np.tile(task.default_joint_pos, (late, 1)), targets])[: len(targets)]
    torque = task.kp * (followed - found.qpos[:, 7:]) - task.kd * found.qvel[:, 6:]
    assert np.abs(np.diff(found.target, axis=0)).max() > 0.01
    np.testing.assert_allclose(found.torque, torque, atol=1e-9)


@pytest.mark.parametrize("name", [name for name in TERRAINS if "bump" in name])
def test_a_speed_bump_is_as_high_as_its_name_says(name: str):
    ground = ground_of(TERRAINS[name][0])
    along = np.linspace(0.0, 4.0, 4001)
    height = np.array([ground.height(x, 0.0) for x in along])
    assert height.max() == pytest.approx(float(name.split()[-2]) / 100.0, abs=1e-4)
    over = along[height > 1e-9]
    assert over[0] == pytest.approx(1.5, abs=0.01) and np.ptp(over) == pytest.approx(0.4, abs=0.01)


def test_stones_differ_by_their_step_and_have_gaps_of_four_centimetres():
    spec, _ = TERRAINS["stepping stones"]
    ground = ground_of(spec)
    along = np.arange(1.0, 5.0, 0.001)
    height = np.array([ground.height(x, 0.0) for x in along])
    stone = height > -0.05
    assert 0.5 * spec.size < np.ptp(height[stone]) <= spec.size
    assert 1.0 - stone.mean() == pytest.approx(0.04 / 0.34, abs=0.02)


def test_means_are_over_the_end_of_the_walk(robot: Robot):
    glide = gliding_rollout(robot, (0.5, 0.0, 0.0))
    qpos, torque, qvel = glide.qpos.copy(), glide.torque.copy(), glide.qvel.copy()
    early = slice(0, len(qpos) - round(1.0 / glide.timestep_s))
    qpos[early, 2] += 0.1
    qvel[early, 0] = 9.0
    torque[early] = 50.0
    qvel[:, 6:], torque[early.stop :] = 1.0, 2.0
    found = figures_of(dataclasses.replace(glide, qpos=qpos, torque=torque, qvel=qvel), 1.0)
    assert found.height_m == pytest.approx(robot.default_root_height)
    assert found.forward_m_s == pytest.approx(0.5)
    assert found.power_w == pytest.approx(2.0 * len(robot.joint_names))


def test_figures_are_against_the_command_that_came_last(robot: Robot):
    profile = CommandProfile(commands=(VelocityCommand(forward=1.5), VelocityCommand(start_s=0.5, yaw_rate=0.3)))
    trial = Trial(seed=0, command=profile, seconds=4.0, measure_s=1.0)
    found = numbers_of(gliding_rollout(robot, (0.0, 0.2, 0.5)), trial, TorqueEnvelope(limit=robot.torque_limit))
    assert found["speed_error"] == pytest.approx(0.2, abs=1e-3)
    assert found["yaw_rate_error"] == pytest.approx(0.2, abs=1e-6)
