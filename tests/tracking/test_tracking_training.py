"""Training of a tracker on a CPU: it trains, resumes, never crosses a seam, and observes what rollouts observe."""

import csv
import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
import torch
from mjlab.tasks.tracking.tracking_env_cfg import make_tracking_env_cfg

from pipeline.batch import ClipPool
from pipeline.feasibility import FeasibilitySettings
from pipeline.files import settings
from pipeline.learning.runner import learn_once
from pipeline.learning.training_error import TrainingError
from pipeline.robot import Robot
from pipeline.tracking.__main__ import main
from pipeline.tracking.bundle import read_tracking_bundle
from pipeline.tracking.clips_command import _bins
from pipeline.tracking.environment import tracking_environment
from pipeline.tracking.export_tracker import export_tracker
from pipeline.tracking.reference import key_link_index, observe, reference_states
from pipeline.tracking.run import TrackingRequest, TrackingRun
from pipeline.tracking.settings import TrackingSettings
from tests.factories.tracking_bundle import tracking_bundle


@pytest.fixture(scope="module")
def bundle(tmp_path_factory, root: Path, robot: Robot) -> Path:
    return tracking_bundle(tmp_path_factory.mktemp("tracking"), root, robot)


@pytest.fixture(scope="module")
def environment(bundle: Path, tmp_path_factory):
    torch.manual_seed(1)
    folder = tmp_path_factory.mktemp("motions")
    env = tracking_environment(read_tracking_bundle(bundle), folder / "motions.npz", 4, "cpu", seed=1)
    env.reset()
    return env


def train(bundle: Path, out: Path, iterations: int, *further: str) -> int:
    given = ["--bundle", bundle, "--out", out, "--device", "cpu", "--num-envs", 4, "--iterations", iterations]
    return main([str(each) for each in (*given, *further)])


def copied(bundle: Path, folder: Path) -> Path:
    folder.mkdir()
    for path in bundle.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    return folder


def test_a_run_trains_resumes_and_is_not_overwritten(bundle: Path, tmp_path: Path, capsys):
    out = tmp_path / "run"
    assert train(bundle, out, 1, "--resume") == 0
    first = np.load(out / "tracker.npz")["L0_w"].copy()
    begun = (out / "curves.csv").read_text()
    assert train(bundle, out, 2, "--resume") == 0
    assert (out / "curves.csv").read_text().startswith(begun), "the first iteration was not run again"
    rows = list(csv.DictReader((out / "curves.csv").read_text().splitlines()))
    assert [int(row["iteration"]) for row in rows] == [1, 2]
    assert json.loads((out / "done.json").read_text())["iterations"] == 2
    assert not np.array_equal(first, np.load(out / "tracker.npz")["L0_w"]), "the second iteration changed the network"
    before = {path.name: path.read_bytes() for path in out.iterdir() if path.is_file()}
    capsys.readouterr()
    assert train(bundle, out, 3) == 2
    assert "has a run. Give --resume to continue it" in capsys.readouterr().err
    other = copied(bundle, tmp_path / "other")
    about = json.loads((other / "bundle.json").read_text())
    (other / "bundle.json").write_text(json.dumps({**about, "licences": ["MIT"]}))
    assert train(other, out, 3, "--resume") == 2
    assert "is a run on another bundle" in capsys.readouterr().err
    with pytest.raises(TrainingError, match="is a run on another bundle"):
        export_tracker(out, other, bundle.parent / "robot", tmp_path / "tracker", {}, ClipPool(workers=1))
    assert not (tmp_path / "tracker").exists()
    assert before == {path.name: path.read_bytes() for path in out.iterdir() if path.is_file()}, "nothing was changed"


def test_processes_take_over_parameters_at_the_first_iteration_alone(bundle: Path, tmp_path: Path, capsys):
    """rsl_rl asks for it at each call of `learn`, with a line of each process that hides the progress; at the second
    one its PPO can not write into the normalizer."""
    torch.distributed.init_process_group("gloo", store=torch.distributed.HashStore(), rank=0, world_size=1)
    try:
        request = TrackingRequest(
            out=tmp_path, num_envs=4, device="cpu", seed=1, iterations=1, minutes=None, resume=False
        )
        runner = TrackingRun(read_tracking_bundle(bundle), request).runner
        runner.is_distributed = True
        learn_once(runner)
        assert "Synchronizing" in capsys.readouterr().out
        learn_once(runner)
        assert "Synchronizing" not in capsys.readouterr().out
        with pytest.raises(RuntimeError, match="nference"):
            runner.alg.broadcast_parameters()
    finally:
        torch.distributed.destroy_process_group()


def test_observations_equal_those_of_mjlab(environment, bundle: Path, robot: Robot):
    """The numpy observation against mjlab's terms, at states with velocities and after actions, to 1e-5."""
    facts = read_tracking_bundle(bundle)
    model = mujoco.MjModel.from_xml_string(facts.robot.mjcf)
    data = mujoco.MjData(model)
    motions, command = facts.motions, environment.command_manager.get_term("motion")
    clips = [
        reference_states(model, motions.root_pos_w[part], motions.root_quat_w[part], motions.joint_pos[part])
        for part in (slice(0, 100), slice(100, 150))
    ]
    links = 1 + key_link_index(robot.link_names, robot.key_links)
    generator = torch.Generator().manual_seed(3)
    for _ in range(5):
        action = 0.5 * torch.randn(4, 21, generator=generator)
        observed, *_ = environment.step(action)
        entity = environment.scene["robot"].data
        origins = environment.scene.env_origins.numpy()
        for env in range(4):
            frame = int(command.time_steps[env])
            reference, local = (clips[0], frame) if frame < 100 else (clips[1], frame - 100)
            data.qpos[:] = environment.sim.data.qpos[env].numpy()
            data.qpos[:3] -= origins[env]
            data.qvel[:] = environment.sim.data.qvel[env].numpy()
            mujoco.mj_kinematics(model, data)
            last = environment.action_manager.action[env].numpy()
            ours = observe(
                data.qpos,
                data.qvel,
                data.xpos[links],
                data.xmat[links],
                reference,
                local,
                robot.default_joint_pos,
                last,
            )
            assert entity.joint_pos.shape[1] == 23
            np.testing.assert_allclose(ours, observed["actor"][env].numpy(), atol=1e-5)


def test_no_episode_crosses_a_seam(environment):
    command = environment.command_manager.get_term("motion")
    for _ in range(60):
        before = command.time_steps.clone()
        environment.step(torch.zeros(4, 21))
        begun = environment.episode_length_buf == 0
        went_on = ~begun
        assert (command.time_steps[went_on] == before[went_on] + 1).all()
        crossed = (before == 99) & (command.time_steps == 100) & went_on
        assert not crossed.any()
    assert command.last_frame[99] == 99 and command.last_frame[100] == 149


def test_bins_cover_all_clips_and_start_no_episode_at_an_end():
    first, size = _bins((0, 100, 150, 153))
    assert sum(size) == 98 + 48 + 1
    assert all(start + count <= stop for start, count, stop in zip(first, size, (49, 98, 148, 151), strict=True))


def test_a_changed_bundle_is_refused(bundle: Path, tmp_path: Path):
    copy = copied(bundle, tmp_path / "bundle")
    (copy / "robot.xml").write_text((copy / "robot.xml").read_text() + " ")
    with pytest.raises(TrainingError, match=r"robot\.xml: its digest differs from the one in bundle\.json"):
        read_tracking_bundle(copy)


def test_training_rollouts_and_kp5_have_the_same_limits(environment, root: Path):
    """Where an episode ends, a rollout is cut, and KP5 rejects what it was given cut otherwise."""
    values = settings.read(root / "data" / "tracking.yaml", TrackingSettings).failure
    kp5 = settings.read(root / "data" / "feasibility.yaml", FeasibilitySettings).tracking
    terms = {"anchor_pos": "root_height", "anchor_ori": "gravity", "ee_body_pos": "end_height", "path": "path"}
    for term, name in terms.items():
        limit = environment.termination_manager.get_term_cfg(term).params["threshold"]
        assert limit == getattr(values, name) == getattr(kp5, name), name


def test_a_fall_counts_in_its_second_and_the_end_of_a_clip_nowhere(environment):
    """Two environments stand on, one is 0.5 m too low at frame 60, one reaches the end of the second clip."""
    command = environment.command_manager.get_term("motion")
    environment.reset()
    command.bin_failed_count.zero_()
    command._current_bin_failed.zero_()
    command.time_steps[:] = torch.tensor([10, 60, 149, 110])
    environment.sim.data.qpos[1, 2] -= 0.5
    environment.step(torch.zeros(4, 21))
    assert environment.termination_manager.terminated.tolist() == [False, True, False, False]
    assert environment.termination_manager.time_outs.tolist() == [False, False, True, False]
    assert torch.nonzero(command.bin_failed_count).flatten().tolist() == [1]


def test_half_of_the_episodes_begin_anywhere_though_one_second_is_hard(environment):
    command = environment.command_manager.get_term("motion")
    environment.reset()
    command.bin_failed_count[:] = torch.tensor([1.0, 0.0, 0.0])
    torch.manual_seed(0)
    begun = []
    for _ in range(400):
        command._adaptive_sampling(torch.arange(4))
        begun += command.time_steps.tolist()
    command.bin_failed_count.zero_()
    command._current_bin_failed.zero_()
    environment.reset()
    elsewhere = 0.5 * (49 + 48) / (49 + 49 + 48)
    assert np.mean(np.array(begun) >= 49) == pytest.approx(elsewhere, abs=0.05)


def test_targets_arrive_late_by_their_lag_but_not_from_another_episode(environment):
    environment.reset()
    term, entity = environment.action_manager.get_term("joint_pos"), environment.scene["robot"].data
    moved = term._index[0]
    term._lag[:] = torch.tensor([[0], [1], [2], [2]])
    environment.episode_length_buf[:] = torch.tensor([5, 5, 5, 0])  # the last one begins
    term.process_actions(torch.zeros(4, 21))
    before = term._target[:, moved].clone()
    term.process_actions(torch.ones(4, 21))
    late = []
    for _ in range(4):
        term.apply_actions()
        late.append((entity.joint_pos_target[:, moved] - before).abs() < 1e-6)
    assert torch.stack(late).sum(dim=0).tolist() == [0, 1, 2, 0]
    drawn = set()
    for _ in range(30):
        environment.reset()
        drawn |= set(term._lag.flatten().tolist())
    assert drawn == {0, 1, 2}, "up to 10 ms, as rollouts have them"


def test_an_episode_ends_where_one_hand_is_too_high(environment, robot: Robot):
    environment.reset()
    for env, side in enumerate(("Left", "Right")):
        environment.sim.data.qpos[env, 7 + robot.joint(f"{side}_Shoulder_Pitch")] -= 2.6
    environment.step(torch.zeros(4, 21))
    assert environment.termination_manager.get_term("ee_body_pos").tolist() == [True, True, False, False]


def test_the_path_is_worth_twice_as_much_as_in_mjlabs_task(environment):
    weights = {name: term.weight for name, term in make_tracking_env_cfg().rewards.items()}
    found = {name: environment.reward_manager.get_term_cfg(name).weight for name in weights}
    assert found == {**weights, "motion_global_root_pos": 2.0 * weights["motion_global_root_pos"]}


def test_gains_and_friction_differ_between_environments(environment, robot: Robot):
    """Stiffness and damping of 4 robots' 23 joints, from nine tenths to eleven tenths."""
    for name in ("stiffness", "damping"):
        motors = environment.scene["robot"].actuators
        factor = torch.cat([getattr(motor, name) / getattr(motor, f"default_{name}") for motor in motors], dim=1)
        assert factor.shape == (4, 23)
        assert 0.9 - 1e-4 <= factor.min() < 0.93 and 1.07 < factor.max() <= 1.1 + 1e-4
    soles = [environment.sim.mj_model.geom(f"robot/{side}_foot_collision").id for side in ("left", "right")]
    friction = environment.sim.model.geom_friction[:, soles, 0]
    assert len(set(friction[:, 0].tolist())) == 4 and torch.equal(friction[:, 0], friction[:, 1])
