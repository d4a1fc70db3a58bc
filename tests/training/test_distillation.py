"""DAgger from the tracker: its observation and action, the clip that follows the robot, and a loss that falls."""

from __future__ import annotations

import csv

import mujoco
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from pipeline.learning.policy_file import Network
from pipeline.robot.kinematics import compiled
from pipeline.tracking.reference import key_link_index, observe, reference_states
from pipeline.tracking.task import ACTION_SCALE
from pipeline.training.__main__ import main
from pipeline.training.bundle import read_bundle
from pipeline.training.config import RECIPE
from pipeline.training.distillation.memory import LabelledStates
from pipeline.training.distillation.teacher import MAX_OFFSET_M, MAX_YAW_OFFSET, ClipTeacher
from pipeline.training.environment import AmpEnvironment
from tests.factories.training_bundle import small_bundle

ENVS = 3


@pytest.fixture(scope="module")
def folder(tmp_path_factory, root, robot):
    return small_bundle(tmp_path_factory.mktemp("distillation"), root, robot, tracker="passive")


@pytest.fixture(scope="module")
def env(folder):
    bundle = read_bundle(folder)
    assert bundle.teacher is not None
    config = RECIPE.changed({"simulation.num_envs": ENVS, "randomization.noise": 0.0})
    teacher = ClipTeacher(bundle.teacher, bundle.robot, config, "cpu")
    return AmpEnvironment(bundle, config, "cpu", seed=1, teacher=teacher, starts=teacher.starts(1))


@pytest.fixture
def teacher(env) -> ClipTeacher:
    env.reset()
    return env.teacher


def test_the_observation_is_the_one_of_the_trackers_rollouts(env, teacher, robot):
    """Term by term as `pipeline.tracking.reference` computes it in numpy, with the clip where it is now."""
    for _ in range(3):
        teacher.record_action(0.1 * torch.ones(ENVS, 21))
        env.step(0.1 * torch.ones(ENVS, 21))
    found, model = teacher.observe(env).double().numpy(), compiled(robot.mjcf, ground=False, timestep=0.005)
    clips, data = teacher.references, mujoco.MjData(model)
    links = 1 + key_link_index(robot.link_names, robot.key_links)
    for at in range(ENVS):
        frame, turn = int(teacher.frame[at]), float(teacher.yaw_offset[at])
        clip = int(np.searchsorted(clips.clip_start, frame, side="right")) - 1
        part = slice(clips.clip_start[clip], clips.clip_start[clip + 1])
        rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        root = clips.root_pos_w[part].astype(float).copy()
        here = root[frame - part.start, :2]
        root[:, :2] = (root[:, :2] - here) @ rotation.T + teacher.path_xy[at].double().numpy()
        quat = np.zeros((len(root), 4))
        spin = np.array([np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)])
        for row, each in enumerate(clips.root_quat_w[part].astype(float)):
            mujoco.mju_mulQuat(quat[row], spin, each)
        states = reference_states(model, root, quat, clips.joint_pos[part].astype(float))
        data.qpos[:], data.qvel[:] = env.sim.data.qpos[at].numpy(), env.sim.data.qvel[at].numpy()
        mujoco.mj_kinematics(model, data)
        expected = observe(
            data.qpos,
            data.qvel,
            data.xpos[links],
            data.xmat[links],
            states,
            int(frame + 1 - part.start),
            robot.default_joint_pos,
            teacher._last_action[at].double().numpy(),
        )
        assert found[at] == pytest.approx(expected, abs=2e-4)


def test_the_action_gives_the_trackers_joint_targets(env, teacher, robot):
    """The tracker's network answers 0 here: its targets are the joints of the next frame."""
    env.step(teacher.act(env))
    teacher._network._layers[-1][1].fill_(0.2)
    action = teacher.act(env)
    teacher._network._layers[-1][1].fill_(0.0)
    teacher.record_action(action)
    assert teacher._last_action == pytest.approx(torch.full((ENVS, 21), 0.2), abs=1e-4)
    expected = teacher.references.joint_pos[teacher.frame.numpy() + 1]
    env.step(action)
    targets = env.scene["robot"].data.joint_pos_target.numpy()
    controlled = [robot.joint(name) for name in robot.controlled]
    assert targets[:, controlled] == pytest.approx(expected[:, controlled] + 0.2 * ACTION_SCALE, abs=1e-5)


def test_the_command_is_the_clips_label_from_the_start_of_an_episode(env, teacher):
    teacher._label[:, 0] = torch.arange(len(teacher._label)) / 1000.0
    env.reset()
    assert torch.equal(env.command[:, 0], teacher.frame / 1000.0)
    observation = env.step(torch.zeros(ENVS, 21))[0]["actor"]
    alive = env.episode_length_buf > 0
    assert torch.equal(observation[alive, -72 + 6], (teacher.frame / 1000.0)[alive])


def test_a_clip_neither_runs_away_from_the_robot_nor_out_of_its_bounds(env, teacher):
    env.sim.data.qpos[0, 0] += 3.0
    env.sim.data.qvel[1, 5] = 5.0
    first, last = teacher._first[teacher.frame].clone(), teacher._last[teacher.frame].clone()
    for _ in range(6):
        env.sim.data.qvel[1, 5] = 5.0
        env.robot_state.invalidate()
        env.sim.forward()
        teacher.advance(env)
        off = (env.robot_state.root_pos_w[:, :2] - teacher.path_xy).norm(dim=1)
        assert (off <= MAX_OFFSET_M + 1e-4).all()
        heading = torch.atan2(env.robot_state.heading_w[:, 1], env.robot_state.heading_w[:, 0])
        turned = heading - teacher._yaw[teacher.frame] - teacher.yaw_offset
        assert (torch.atan2(torch.sin(turned), torch.cos(turned)).abs() <= MAX_YAW_OFFSET + 1e-4).all()
        assert ((teacher.frame >= first) & (teacher.frame <= last)).all()


def test_the_nearest_of_three_frames_is_the_one_with_the_robots_joints(env, teacher):
    wave = int(teacher.references.clip_start[1]) + 30
    expected = torch.full((ENVS,), wave)
    joints = teacher._joint_pos[torch.tensor([wave - 1, wave, wave + 1])]
    assert teacher._nearest(expected, joints).tolist() == [wave - 1, wave, wave + 1]


def test_a_fall_is_a_tracking_failure_and_the_last_frame_ends_the_episode(env, teacher):
    env.sim.data.qpos[0, 2] -= 0.3
    teacher.frame[1] = teacher._last[teacher.frame[1]] - 2
    env.robot_state.invalidate()
    teacher.advance(env)
    assert teacher.tracking_failed.tolist() == [True, False, False]
    assert teacher.clip_ended.tolist() == [False, True, False]


def test_the_memory_keeps_the_newest_states():
    memory = LabelledStates(5, 2, 1, "cpu")
    for first in (0.0, 3.0):
        values = torch.arange(first, first + 4.0)[:, None]
        memory.add(values.repeat(1, 2), values)
    observation, label = memory.draw(200)
    assert memory.filled == 5
    assert set(label.flatten().tolist()) == {2.0, 3.0, 4.0, 5.0, 6.0} - {2.0} | {3.0}
    assert torch.equal(observation, label.repeat(1, 2))


def test_the_loss_falls_without_a_gpu(tmp_path, root, robot):
    """The first experience without a GPU, in small: the student of the shipped tracker imitates it ever better while
    the teacher acts; later, with states that it visits itself in the memory, it still fits better than at first."""
    folder = small_bundle(tmp_path, root, robot, tracker="shipped")
    given = ["--bundle", str(folder), "--out", str(tmp_path / "run"), "--device", "cpu", "--stages", "distillation"]
    changed = ["simulation.num_envs=8", "distillation.iterations=16"]
    assert main([*given, *(text for each in changed for text in ("--set", each))]) == 0
    rows = list(csv.DictReader((tmp_path / "run" / "curves.csv").read_text().splitlines()))
    loss, fit = ([float(row[name]) for row in rows] for name in ("loss", "fit"))
    share = [float(row["teacher_share"]) for row in rows]
    assert share[:5] == [1.0] * 5 and share[-1] == 0.0
    assert loss[4] < 0.3 * loss[0]
    assert max(fit[-3:]) < 0.8 * fit[0]
    with np.load(tmp_path / "run" / "policy.npz", allow_pickle=False) as arrays:
        network = Network(dict(arrays), "cpu")
    assert network(torch.zeros(2, 720)).shape == (2, 21)


def test_a_trunk_tilted_by_90_degrees_from_the_clip_fails_tracking(env, teacher):
    for row, lean_deg in enumerate((0.0, 60.0, 95.0)):
        env.sim.data.qpos[row, 3:7] = wxyz(Rotation.from_euler("x", lean_deg, degrees=True))
    env.sim.forward()
    env.robot_state.invalidate()
    teacher.advance(env)
    assert teacher.tracking_failed.tolist() == [False, False, True]


def test_a_robot_on_the_path_of_its_rotated_clip_has_no_error(env, teacher, monkeypatch):
    """The clip walks to the front and to the left, and is turned by another angle in each environment."""
    turns, per_frame = torch.tensor([0.0, 1.2, -2.5]), torch.tensor([0.02, 0.008, 0.0])
    walked = teacher._root_pos + torch.arange(len(teacher._root_pos))[:, None] * per_frame
    monkeypatch.setattr(teacher, "_root_pos", walked)
    frame = torch.full((ENVS,), int(teacher.references.clip_start[1]) + 30)
    teacher.begin(env, torch.ones(ENVS, dtype=torch.bool), frame, turns)
    start = teacher.path_xy.double().numpy()
    rotations = [Rotation.from_euler("z", float(turn)) for turn in turns]
    for step in range(1, 21):
        env.sim.data.qpos[:, 7:] = teacher._joint_pos[frame + step]
        for row, rotation in enumerate(rotations):
            env.sim.data.qpos[row, 3:7] = wxyz(rotation)
            moved = start[row] + rotation.apply(step * per_frame.double().numpy())[:2]
            env.sim.data.qpos[row, :2] = torch.from_numpy(moved).float()
        env.sim.forward()
        env.robot_state.invalidate()
        teacher.advance(env)
        assert teacher.frame.tolist() == (frame + step).tolist()
        assert teacher.path_xy.numpy() == pytest.approx(env.sim.data.qpos[:, :2].numpy(), abs=1e-4)
        assert teacher.yaw_offset.numpy() == pytest.approx(turns.numpy(), abs=1e-4)


def wxyz(turn: Rotation) -> torch.Tensor:
    x, y, z, w = turn.as_quat()
    return torch.tensor([w, x, y, z], dtype=torch.float32)
