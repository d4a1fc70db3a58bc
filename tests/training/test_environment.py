"""The environment on the CPU: observation, features, actions and mirror against the rest of the project."""

from __future__ import annotations

import math
from typing import cast

import mujoco
import numpy as np
import pytest
import torch
from mjlab.utils.lab_api.math import matrix_from_quat, quat_apply_inverse
from tensordict import TensorDict

from pipeline.deployment import deployment_task
from pipeline.deployment.controller import History, Reading, frame
from pipeline.expert.frames import expert_frames
from pipeline.learning.policy_file import Network
from pipeline.training.amp.features import frame_features, rotation_vector, state_features
from pipeline.training.amp.symmetry import Mirror, augment
from pipeline.training.bundle import ExpertFrames, read_bundle
from pipeline.training.config import AFTER_CHANGE_S, PAPER, RECIPE
from pipeline.training.environment import AmpEnvironment
from pipeline.training.mdp.commands import SLEW
from pipeline.training.mdp.start_states import expert_states
from tests.factories.given_command import give_command
from tests.factories.robot_clips import wandering
from tests.factories.training_bundle import small_bundle

ENVS = 4
QUIET = {
    "simulation.num_envs": ENVS,
    "randomization.noise": 0.0,
    "randomization.gains": (1.0, 1.0),
    "randomization.delay_s": 0.0,
    "randomization.slope_deg": 0.0,
    "randomization.rotor_link_share": 0.0,
    "pushes.kick_m_s": (0.0, 0.0),
    "pushes.impulse_n_s": (0.0, 0.0),
}


@pytest.fixture(scope="module")
def bundle(tmp_path_factory, root, robot):
    return read_bundle(small_bundle(tmp_path_factory.mktemp("training"), root, robot))


@pytest.fixture(scope="module")
def env(bundle):
    env = AmpEnvironment(bundle, RECIPE.changed(QUIET), "cpu", seed=1)
    env.reset()
    return env


@pytest.fixture
def rate(env):
    """Rate of change of commands (n, 1) [1/s^2], as before after the test."""
    before = env.velocity_command._rate.clone()
    yield env.velocity_command._rate
    env.velocity_command._rate.copy_(before)


def wandering_frames(robot, later: int = 0) -> np.ndarray:
    return expert_frames(wandering(robot), robot)[np.array([5, 30, 60, 90]) + later].astype(np.float32)


def put(env, frames: np.ndarray) -> None:
    """Write expert frames as the environments' states."""
    facts = env.context.bundle.robot
    expert = ExpertFrames(
        frames=frames, command=np.zeros((4, 3), np.float32), clip_start=np.array([0, 4]), clip_weight=np.ones(1)
    )
    index, none = facts.index(facts.controlled), np.full((4, 3), np.nan, np.float32)
    states = expert_states(expert, np.arange(4), none, index, facts.default_joint_pos, "cpu")
    ang_vel_b = quat_apply_inverse(states.root_quat, states.ang_vel_w)
    env.sim.data.qpos[:] = torch.cat([states.root_pos, states.root_quat, states.joint_pos], dim=1)
    env.sim.data.qvel[:] = torch.cat([states.lin_vel_w, ang_vel_b, states.joint_vel], dim=1)
    env.sim.forward()
    env.robot_state.invalidate()


def test_the_lowest_corner_of_a_sole_moves_as_the_jacobian_says(env, robot):
    put(env, wandering_frames(robot))
    model, found = env.sim.mj_model, env.robot_state.lowest_corner_vel_w
    data = mujoco.MjData(model)
    jacobian = np.zeros((3, model.nv))
    for number in range(ENVS):
        data.qpos[:], data.qvel[:] = env.sim.data.qpos[number].numpy(), env.sim.data.qvel[number].numpy()
        mujoco.mj_forward(model, data)
        for side, foot in enumerate(("left_foot", "right_foot")):
            geom = data.geom(f"robot/{foot}_collision")
            size = model.geom(geom.id).size
            signs = np.array([[x, y, -1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
            corners_w = geom.xpos + (signs * size) @ geom.xmat.reshape(3, 3).T
            lowest_w = corners_w[np.argmin(corners_w[:, 2])]
            mujoco.mj_jac(model, data, jacobian, None, lowest_w, model.body(f"robot/{foot}_link").id)
            np.testing.assert_allclose(found[number, side].numpy(), jacobian @ data.qvel, atol=2e-4)


def test_features_of_states_are_those_of_the_expert_frames_they_were_set_to(env, robot):
    states = []
    for later in (-1, 0, 1):
        put(env, wandering_frames(robot, later))
        states.append(env.positions())
    expected = frame_features(torch.from_numpy(wandering_frames(robot))).numpy()
    found = state_features(torch.stack(states, dim=1)).numpy()
    assert np.abs(expected).max() > 0.5
    np.testing.assert_allclose(found[:, :33], expected[:, :33], atol=2e-6)
    np.testing.assert_allclose(found[:, 33:], expected[:, 33:], atol=2e-4)  # of single precision by 40 ms


def test_windows_have_the_velocities_of_the_positions_that_were_walked(env):
    env.reset()
    index, walked = env.controlled_index, []
    for step in range(6):
        env.step(0.5 * torch.randn(ENVS, 21, generator=torch.Generator().manual_seed(step)))
        assert not env.reset_buf.any()
        walked.append((env.robot_state.joint_pos[:, index].clone(), env.robot_state.root_pos_w.clone()))
    joint_pos, root_pos = zip(*walked, strict=True)
    newest = env._motion[:, -1]
    torch.testing.assert_close(newest[:, :21], joint_pos[-2])
    torch.testing.assert_close(newest[:, 39:60], (joint_pos[-1] - joint_pos[-3]) / (2.0 * env.step_dt))
    speed = torch.linalg.norm((root_pos[-1] - root_pos[-3]) / (2.0 * env.step_dt), dim=1)
    torch.testing.assert_close(torch.linalg.norm(newest[:, 33:36], dim=1), speed, atol=1e-4, rtol=0.0)
    assert torch.equal(newest[:, 60:], env.command)


@pytest.mark.parametrize("angle", [0.0, 1e-4, 0.5, 2.0])
def test_the_rotation_vector_is_the_axis_by_the_angle(angle):
    axis = torch.nn.functional.normalize(torch.tensor([[0.3, -0.5, 0.8]]), dim=1)
    half = torch.tensor([[0.5 * angle]])
    quat = torch.cat([torch.cos(half), torch.sin(half) * axis], dim=1)
    torch.testing.assert_close(rotation_vector(matrix_from_quat(quat)), angle * axis, atol=1e-6, rtol=1e-5)


def test_the_observation_is_the_deployments(env, robot):
    task = deployment_task(robot)
    env.reset()
    history = History(task)
    history.push(_frame(env, task, np.zeros(len(task.policy_joints))))
    for step in range(3):
        action = 0.1 * torch.randn(ENVS, len(task.policy_joints), generator=torch.Generator().manual_seed(step))
        observation, _, terminated, timed_out, _ = env.step(action)
        assert not (terminated | timed_out)[0]
        wanted = history.push(_frame(env, task, action[0].numpy()))
        assert observation["actor"][0].numpy() == pytest.approx(wanted, abs=1e-5)


def _frame(env, task, last):
    read = env.robot_state
    reading = Reading(
        gyro_b=read.ang_vel_b[0].double().numpy(),
        gravity_b=read.gravity_b[0].double().numpy(),
        joint_pos=read.joint_pos[0].double().numpy(),
        joint_vel=read.joint_vel[0].double().numpy(),
    )
    return frame(task, reading, env.command[0].double().numpy(), last.astype(float))


def test_actions_are_targets_of_a_quarter_radian_in_the_networks_order(env, robot):
    task = deployment_task(robot)
    env.reset()
    action = torch.arange(len(task.policy_joints)).float().repeat(ENVS, 1) / 100.0
    env.step(action)
    target = env.scene["robot"].data.joint_pos_target[0].numpy()
    wanted = np.array(task.default_joint_pos)
    wanted[task.policy_index] += 0.25 * action[0].numpy()
    assert target == pytest.approx(wanted, abs=1e-6)


def test_motors_are_held_by_their_limits(env):
    env.reset()
    for _ in range(3):
        env.step(torch.full((ENVS, 21), 40.0))
        torque = env.scene["robot"].data.qfrc_actuator
        assert (torque.abs() <= env.effort_limit + 1e-3).all()
    assert (torque.abs() > 0.9 * env.effort_limit).any()


def test_windows_are_valid_once_they_are_full_and_never_cross_a_reset(env, rate):
    rate.fill_(math.inf)
    env._positions += 1.0  # robots that were elsewhere before
    env.reset()
    span = env._motion.shape[1]
    env.velocity_command.age.fill_(AFTER_CHANGE_S)
    for step in range(1, span + 4):
        *_, extras = env.step(torch.zeros(ENVS, 21))
        kept = env.episode_length_buf == step
        assert torch.equal(extras["motion_valid"][kept], torch.full_like(kept[kept], step > span + 1))
        trunk_m_s = extras["motion"][extras["motion_valid"]][..., 33:36].abs()
        assert (trunk_m_s < 3.0).all(), "a velocity across the reset"
    env._reset_idx(torch.tensor([0]))
    *_, extras = env.step(torch.zeros(ENVS, 21))
    assert not extras["motion_valid"][0]


@pytest.mark.parametrize("size", [math.inf, SLEW])
def test_windows_are_valid_once_the_command_is_a_second_old_and_constant(env, rate, size):
    rate.fill_(size)
    env.reset()
    span, steps, seen = env._motion.shape[1], round(AFTER_CHANGE_S / env.step_dt), []
    env.episode_length_buf.fill_(span + 2)
    env.velocity_command.time_left.fill_(1e-3)
    read = 0
    for step in range(1, 4 * steps):
        *_, extras = env.step(torch.zeros(ENVS, 21))
        seen.append(env.command.clone())
        kept = env.episode_length_buf == span + 2 + step
        constant = torch.stack([(each == seen[-1]).all(dim=1) for each in seen[-span:]]).all(dim=0)
        if step != steps:  # the age is a sum of rounded steps
            assert torch.equal(extras["motion_valid"][kept], (constant & (step > steps))[kept])
        read += int(extras["motion_valid"][kept].sum())
    assert read > 0


def test_without_commands_a_new_command_makes_no_window_invalid(bundle):
    env = AmpEnvironment(bundle, RECIPE.changed({**QUIET, "discriminator.by_command": False}), "cpu", seed=1)
    env.reset()
    steps = env._motion.shape[1] + 3
    for _ in range(steps):
        *_, extras = env.step(torch.zeros(ENVS, 21))
        assert (env.velocity_command.age < AFTER_CHANGE_S).all()
    whole = env.episode_length_buf == steps
    assert whole.any() and extras["motion_valid"][whole].all()
    assert extras["motion"].shape[2] == 18 + 2 * 21


def test_the_mirror_is_its_own_inverse_and_agrees_with_the_robots(env, robot):
    task, mirror = deployment_task(robot), Mirror(env.context.bundle.robot, "cpu")
    obs = TensorDict({"actor": torch.randn(3, 720), "critic": torch.randn(3, 80)}, batch_size=[3])
    twice = mirror.observations(mirror.observations(obs))
    assert torch.equal(twice["actor"], obs["actor"])
    assert torch.equal(twice["critic"], obs["critic"])
    assert torch.equal(mirror.actor(obs["actor"]), mirror.observations(obs)["actor"])
    joints = np.random.default_rng(0).normal(size=len(robot.joint_names))
    joints[~np.isin(robot.joint_names, robot.controlled)] = 0.0
    mirrored = robot.mirror_sign * joints[robot.mirror_index]
    once = mirror.actions(torch.from_numpy(joints[task.policy_index])[None])
    assert once[0].numpy() == pytest.approx(mirrored[task.policy_index])


def test_samples_are_followed_by_their_mirror_images(env):
    env.mirror = Mirror(env.context.bundle.robot, "cpu")
    obs = TensorDict({"actor": torch.randn(2, 720), "critic": torch.randn(2, 80)}, batch_size=[2])
    actions = torch.randn(2, 21)
    both, both_actions = augment(env, obs, actions)
    assert torch.equal(both["actor"], torch.cat([obs["actor"], env.mirror.actor(obs["actor"])]))
    assert torch.equal(both_actions, torch.cat([actions, env.mirror.actions(actions)]))


@pytest.mark.shared
def test_a_known_good_policy_walks_in_the_environment(bundle, policies):
    """Observation, order, gains and physics are right where a policy trained elsewhere walks as it should."""
    with np.load(policies / "t1_walk.npz") as arrays:
        published = Network(dict(arrays), "cpu")
    still = {"simulation.reference_share": 0.0, "simulation.stall_s": 0.0, "commands.slew_share": 0.0}
    env = AmpEnvironment(bundle, RECIPE.changed({**QUIET, **still}), "cpu", seed=1)
    observation, _ = env.reset()
    wanted = torch.tensor([[0.6, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    speeds = []
    for step in range(140):
        give_command(env, torch.arange(ENVS), wanted)
        observation, _, terminated, _, _ = env.step(published(cast(torch.Tensor, observation["actor"])))
        assert not terminated.any(), f"fell at step {step}"
        if step >= 90:
            speeds.append(env.robot_state.velocity)
    mean = torch.stack(speeds).mean(dim=0)
    assert mean[[0, 1, 3], 0].numpy() == pytest.approx([0.52, 0.95, 0.0], abs=0.1)
    assert mean[2, 2].item() == pytest.approx(0.98, abs=0.1)


def test_the_drop_at_the_start_of_an_episode_is_no_touchdown(bundle):
    env = AmpEnvironment(bundle, RECIPE.changed({**QUIET, "simulation.reference_share": 0.0}), "cpu", seed=1)
    for _ in range(2):
        env.reset()
        landed = 0
        for _ in range(15):
            env.step(torch.zeros(ENVS, 21))
            landed += int(env.robot_state.landed.sum())
        assert env.robot_state.contacts.all() and landed == 0


def test_the_papers_preset_runs_on_a_heightfield(bundle):
    rough = AmpEnvironment(bundle, PAPER.changed({"simulation.num_envs": 2}), "cpu", seed=1)
    rough.reset()
    for _ in range(3):
        observation, reward, *_ = rough.step(torch.zeros(2, 21))
    assert rough.sim.mj_model.nhfield > 0
    assert observation["actor"].shape == (2, 720)
    assert torch.isfinite(reward).all()


def test_each_reward_term_gives_one_finite_number_an_environment(bundle):
    """With every option of the rewards at a weight, so that a new term is checked as soon as it has one."""
    weights = {
        name: -0.5 if facts["most"] == 0.0 else 0.5 for name, value, facts in RECIPE.options() if _weight(name, value)
    }
    env = AmpEnvironment(bundle, RECIPE.changed({**QUIET, **weights}), "cpu", seed=1)
    env.reset()
    manager, count = env.reward_manager, 3
    totals, rewards = torch.zeros(len(manager.active_terms)), 0.0
    for _ in range(count):
        _, reward, *_ = env.step(torch.zeros(ENVS, 21))
        for name in manager.active_terms:
            cfg = manager.get_term_cfg(name)
            value = cfg.func(env, **cfg.params)
            assert value.shape == (ENVS,), name
            assert torch.isfinite(value).all(), name
        totals += torch.tensor(
            [[rate[0] for _, rate in manager.get_active_iterable_terms(number)] for number in range(ENVS)]
        ).mean(dim=0)
        rewards += reward.mean().item()
    figures = env.record.take(env.step_dt)
    found = [figures[f"reward_{name}"] for name in manager.active_terms]
    assert found == pytest.approx((totals / count).tolist(), rel=1e-4, abs=1e-6)
    assert sum(found) * env.step_dt == pytest.approx(rewards / count, rel=1e-4)


def _weight(name: str, value) -> bool:
    return name.startswith("rewards.") and isinstance(value, float)


@pytest.mark.parametrize("by_command", [True, False])
def test_episodes_begin_at_frames_that_keep_their_command(bundle, by_command):
    bundle.expert.command[:] = [0.7, 0.1, 0.0]
    changed = {**QUIET, "simulation.num_envs": 60, "discriminator.by_command": by_command}
    env = AmpEnvironment(bundle, RECIPE.changed(changed), "cpu", seed=1)
    env.reset()
    own = ~env.start_command.isnan().any(dim=1)
    assert 0.25 < own.float().mean() < 0.6 if by_command else not own.any()
    assert env.command[own] == pytest.approx(env.start_command[own])
    at_frames = (env.start_velocity != 0.0).any(dim=1)
    assert 0.6 < at_frames.float().mean() < 1.0
    height = env.sim.data.qpos[:, 2]
    assert ((height > 0.5) & (height < 0.9)).all()


def test_the_averaged_velocity_reaches_two_thirds_of_a_step_after_0_4_s(env):
    env.reset()
    env.sim.data.qvel[:, :3] = torch.tensor([0.7, -0.4, 0.0])
    env.robot_state.invalidate()
    velocity = env.robot_state.velocity.clone()
    env.robot_state._mean.zero_()
    for _ in range(round(0.4 / env.step_dt)):
        env.robot_state.advance()
    share = (env.robot_state.mean_velocity * velocity).sum(dim=1) / velocity.square().sum(dim=1)
    assert share.numpy() == pytest.approx(1.0 - math.exp(-1.0), abs=0.02)
    env.reset()
