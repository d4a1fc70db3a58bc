"""The environment on the CPU: observation, features and mirror against the rest of the project, one run with resume."""

from __future__ import annotations

import csv
import dataclasses
import json
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
import torch
from rsl_rl.runners import OnPolicyRunner
from tensordict import TensorDict

from pipeline.deployment import deployment_task, load_policy
from pipeline.deployment.observation import History, frame
from pipeline.expert.frames import expert_frames
from pipeline.learning.checkpoint import load_checkpoint, newest_checkpoint
from pipeline.learning.policy_file import act, policy_arrays
from pipeline.training.bundle import read_bundle
from pipeline.training.command import main
from pipeline.training.environment import AmpEnvironment
from pipeline.training.export_policy import main as export
from pipeline.training.first_posture import first_action
from pipeline.training.initial_state import _of_frames
from pipeline.training.mirror import Mirror, augment
from pipeline.training.motion_features import frame_features
from pipeline.training.presets import DEFAULT, preset
from tests.factories.robot_clips import wandering
from tests.factories.training_bundle import small_bundle

ENVS = 4
QUIET = {"noise": (0.0, 0.0, 0.0, 0.0), "push_impulse": (0.0, 0.0), "gain_range": (1.0, 1.0), "action_lag_steps": 0}
SMALL = ["expert_windows=200", "replay_windows=200", "discriminator_batch=32", "discriminator_steps=2"]


@pytest.fixture(scope="module")
def bundle_folder(tmp_path_factory, root, robot):
    return small_bundle(tmp_path_factory.mktemp("training"), root, robot)


@pytest.fixture(scope="module")
def env(bundle_folder):
    options = preset("tracking_amp").changed(**QUIET, slide_of="lowest")
    env = AmpEnvironment(read_bundle(bundle_folder), options, ENVS, "cpu", seed=1)
    env.reset()
    return env


def put(env, frames: torch.Tensor) -> None:
    """Write expert frames as the environments' states."""
    pos, quat, joints, lin_vel_w, ang_vel_w, joint_vel = _of_frames(env, frames)
    ids, robot = torch.arange(ENVS), env.scene["robot"]
    robot.write_root_link_pose_to_sim(torch.cat([pos, quat], dim=1), env_ids=ids)
    robot.write_root_link_velocity_to_sim(torch.cat([lin_vel_w, ang_vel_w], dim=1), env_ids=ids)
    robot.write_joint_state_to_sim(joints, joint_vel, env_ids=ids)
    env.sim.forward()
    env.readings.fresh()


def test_the_lowest_corner_of_a_sole_moves_as_the_jacobian_says(env, robot):
    taken = torch.from_numpy(expert_frames(wandering(robot), robot)[[5, 30, 60, 90]]).float()
    put(env, taken)
    model, told = env.sim.mj_model, env.readings.lowest_corner_vel_w
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
            np.testing.assert_allclose(told[number, side].numpy(), jacobian @ data.qvel, atol=2e-4)


def test_features_of_a_state_are_those_of_the_expert_frame_it_was_set_to(env, robot):
    taken = torch.from_numpy(expert_frames(wandering(robot), robot)[[5, 30, 60, 90]]).float()
    put(env, taken)
    assert env.motion_features().numpy() == pytest.approx(frame_features(taken).numpy(), abs=2e-6)


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
    read = env.readings
    return frame(
        task,
        gyro_b=read.ang_vel_b[0].double().numpy(),
        gravity_b=read.gravity_b[0].double().numpy(),
        command=env.command[0].double().numpy(),
        joint_pos=read.joint_pos[0].double().numpy(),
        joint_vel=read.joint_vel[0].double().numpy(),
        last_action=last.astype(float),
    )


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


def test_windows_are_valid_once_they_are_full_and_never_cross_a_reset(env):
    env.reset()
    span = env._motion.shape[1]
    for step in range(1, span + 2):
        *_, extras = env.step(torch.zeros(ENVS, 21))
        kept = env.episode_length_buf == step
        assert torch.equal(extras["motion_valid"][kept], torch.full_like(kept[kept], step >= span))
    env._reset_idx(torch.tensor([0]))
    *_, extras = env.step(torch.zeros(ENVS, 21))
    assert not extras["motion_valid"][0]


def test_the_mirror_is_its_own_inverse_and_agrees_with_the_robots(env, robot):
    task = deployment_task(robot)
    for signs in ([], [1.0, 1.0], [1.0, -1.0, 1.0]):
        beyond, further = torch.tensor(signs), len(signs)
        mirror = Mirror(env.context.bundle.robot, "cpu", beyond)
        obs = TensorDict({"actor": torch.randn(3, 720), "critic": torch.randn(3, 77 + further)}, batch_size=[3])
        once_obs = mirror.observations(obs)
        twice = mirror.observations(once_obs)
        assert torch.equal(twice["actor"], obs["actor"])
        assert torch.equal(twice["critic"], obs["critic"])
        assert torch.equal(once_obs["critic"][:, 77:], obs["critic"][:, 77:] * beyond)
    joints = np.random.default_rng(0).normal(size=len(robot.joint_names))
    joints[~np.isin(robot.joint_names, robot.controlled)] = 0.0
    mirrored = robot.mirror_sign * joints[robot.mirror_index]
    once = mirror.actions(torch.from_numpy(joints[task.policy_index])[None])
    assert once[0].numpy() == pytest.approx(mirrored[task.policy_index])


def test_who_stands_is_mirrored_unless_told_otherwise(bundle_folder):
    robot = read_bundle(bundle_folder).robot
    obs = TensorDict({"actor": torch.randn(4, 720), "critic": torch.randn(4, 77)}, batch_size=[4])
    obs["actor"][:2, -72 + 6 : -72 + 9] = 0.0
    obs["actor"][1:3, 6:9] = 0.0  # the oldest command does not count
    actions, mirror = torch.randn(4, 21), Mirror(robot, "cpu")
    for mirrors in (True, False):
        options = preset("long_steps").changed(mirror_standing=mirrors)
        env = SimpleNamespace(mirror=mirror, unwrapped=SimpleNamespace(context=SimpleNamespace(options=options)))
        both, both_actions = augment(env, obs, actions)
        same = [not mirrors, not mirrors, False, False]
        for name, own, image in (
            ("actor", obs["actor"], mirror.observations(obs)["actor"]),
            ("critic", obs["critic"], mirror.observations(obs)["critic"]),
        ):
            wanted = torch.stack([own[at] if same[at] else image[at] for at in range(4)])
            assert torch.equal(both[name], torch.cat([own, wanted]))
        wanted = torch.stack([actions[at] if same[at] else mirror.actions(actions)[at] for at in range(4)])
        assert torch.equal(both_actions, torch.cat([actions, wanted]))


def test_a_reward_is_the_sum_of_the_tables_rows(env):
    env.readings._set_down[:] = 0
    env.reset()
    assert (env.readings._set_down == -1).all()
    (*_,) = env.step(torch.zeros(ENVS, 21))
    reward = env.reward_manager.get_term_cfg("task").func
    values = reward.values(env)
    assert values.shape == (ENVS, len(reward.rows))
    assert torch.isfinite(values).all()


def test_of_the_environments_without_noise_a_share_is_pushed(bundle_folder):
    options = preset("calm_steps").changed(
        quiet_share=0.5, push_impulse=(40.0, 40.0), push_interval_s=(0.02, 0.02), reference_share=0.0
    )
    env = AmpEnvironment(read_bundle(bundle_folder), options, ENVS, "cpu", seed=1)
    env.reset()
    assert env.quiet.tolist() == [True, True, False, False]
    assert env.pushed.tolist() == [False, True, True, True]
    force = torch.zeros(ENVS)
    for _ in range(4):
        env.step(torch.zeros(ENVS, 21))
        force = torch.maximum(force, env.sim.data.xfrc_applied[:, :, :3].norm(dim=2).amax(dim=1))
    assert force[0] == 0.0
    assert (force[1:] >= 0.2 * 400.0 - 1e-3).all(), "at least a fifth of 40 N s in a tenth of a second"


def test_a_run_trains_resumes_and_ends_as_a_policy(bundle_folder, tmp_path, capsys, monkeypatch):
    out = tmp_path / "run"
    learn, tracking = OnPolicyRunner.learn, []

    def noted(runner: OnPolicyRunner, *given):
        tracking.append(float(runner.env.unwrapped.tracked_clip.tracks.float().mean()))
        learn(runner, *given)

    monkeypatch.setattr(OnPolicyRunner, "learn", noted)
    given = ["--bundle", str(bundle_folder), "--out", str(out), "--device", "cpu", "--num-envs", "4", "--seed", "3"]
    changed = ["std_end=0.5", "std_iterations=0,1", "init_posture=clips", "steps=6", "mirror_standing=false"]
    changed += ["tracked=1", "tracked_iterations=0,1", "assist=1"]
    given += [text for option in [*SMALL, *changed] for text in ("--set", option)]
    assert main([*given, "--iterations", "1"]) == 0
    assert main([*given, "--iterations", "2", "--resume"]) == 0
    assert "iteration 2 of 2" in capsys.readouterr().out
    assert tracking == [1.0, 0.0], "a resumed run begins where its schedules are"
    rows = list(csv.DictReader((out / "curves.csv").read_text().splitlines()))
    assert [row["iteration"] for row in rows] == ["1", "2"]
    assert json.loads((out / "done.json").read_text())["iterations"] == 2
    config = json.loads((out / "config.json").read_text())
    assert config["options"]["style"] == preset(DEFAULT).style
    newest = newest_checkpoint(out / "checkpoints")
    assert newest is not None
    assert newest.name == "model_000002.pt"
    _check_policy(out, newest, bundle_folder)


def _check_policy(out, newest, bundle_folder):
    policy = load_policy(out / "policy.npz")
    assert policy.gains is not None
    state = load_checkpoint(newest, "cpu")
    assert state["actor_state_dict"]["distribution.std_param"].max() <= 0.3, "half of what exploration begins with"
    bundle = read_bundle(bundle_folder)
    begun = first_action(bundle, preset(DEFAULT), seed=3)
    assert policy.layers[-1][1] == pytest.approx(begun, abs=0.05), "two iterations from where it began"
    arrays = policy_arrays(state, bundle.robot)
    observation = torch.randn(5, 720)
    assert policy.act(observation.double().numpy()) == pytest.approx(act(arrays, observation).numpy(), abs=1e-4)
    mean = out / "mean.npz"
    first = str(out / "checkpoints" / "model_000001.pt")
    assert (
        export(["--checkpoint", str(newest), "--checkpoint", first, "--bundle", str(bundle_folder), "--out", str(mean)])
        == 0
    )
    assert not np.allclose(load_policy(mean).layers[0][0], policy.layers[0][0])


@pytest.mark.shared
def test_a_known_good_policy_walks_in_the_environment(env, policies):
    """Observation, order, gains and physics are right where a policy trained elsewhere walks as it should."""
    with np.load(policies / "t1_walk.npz") as arrays:
        published = dict(arrays)
    options = env.context.options
    env.context = dataclasses.replace(
        env.context, options=options.changed(reference_share=0.0, resample_s=(100.0, 100.0), stall_s=100.0)
    )
    observation, _ = env.reset()
    wanted = torch.tensor([[0.6, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    speeds = []
    for step in range(140):
        env.velocity_command.give(torch.arange(ENVS), wanted)
        observation, _, terminated, _, _ = env.step(act(published, observation["actor"]))
        assert not terminated.any(), f"fell at step {step}"
        if step >= 90:
            speeds.append(env.readings.velocity)
    mean = torch.stack(speeds).mean(dim=0)
    assert mean[[0, 1, 3], 0].numpy() == pytest.approx([0.52, 0.95, 0.0], abs=0.1)
    assert mean[2, 2].item() == pytest.approx(0.98, abs=0.1)


def test_the_papers_preset_runs_on_a_heightfield(bundle_folder):
    rough = AmpEnvironment(read_bundle(bundle_folder), preset("paper"), 2, "cpu", seed=1)
    rough.reset()
    for _ in range(3):
        observation, reward, *_ = rough.step(torch.zeros(2, 21))
    assert rough.sim.mj_model.nhfield > 0
    assert observation["actor"].shape == (2, 720)
    assert torch.isfinite(reward).all()
