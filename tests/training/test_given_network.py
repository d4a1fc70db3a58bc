"""Training that begins with the network of a policy file."""

from __future__ import annotations

import dataclasses
import hashlib
import json

import numpy as np
import pytest
import torch

from pipeline.learning.checkpoint import newest_checkpoint
from pipeline.learning.policy_file import act, write_policy
from pipeline.learning.training_error import TrainingError
from pipeline.training.amp_ppo import FIRST_RATE
from pipeline.training.bundle import read_bundle
from pipeline.training.command import main
from pipeline.training.export_policy import main as export
from pipeline.training.given_network import arrays_of, moved_towards
from pipeline.training.presets import preset
from pipeline.training.run import RunRequest, TrainingRun
from tests.factories.training_bundle import small_bundle

SMALL = {"expert_windows": 200, "replay_windows": 200, "discriminator_batch": 32, "discriminator_steps": 2, "steps": 4}
SMALL |= {"keep": 0.0}  # test_kept_walk.py has that


@pytest.fixture(scope="module")
def folder(tmp_path_factory, root, robot):
    return small_bundle(tmp_path_factory.mktemp("training"), root, robot)


@pytest.fixture(scope="module")
def shipped(root):
    with np.load(root / "robots/t1/policies/walk/policy.npz", allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


def request(out, policy, **changed) -> RunRequest:
    return RunRequest(
        out=out,
        preset="refined_steps",
        options=preset("refined_steps").changed(**SMALL, **changed),
        num_envs=4,
        device="cpu",
        seed=1,
        iterations=2,
        minutes=None,
        resume=False,
        start_from=policy,
    )


def bundle_for(folder, arrays):
    """The bundle with the gains of a policy: the shipped one's robot is the adapted one."""
    bundle = read_bundle(folder)
    gains = {name: np.asarray(arrays[name], dtype=float) for name in ("kp", "kd", "default_joint_pos")}
    return dataclasses.replace(bundle, robot=dataclasses.replace(bundle.robot, **gains))


@pytest.fixture
def run(folder, shipped, tmp_path):
    write_policy(tmp_path / "begin.npz", shipped)
    return TrainingRun(bundle_for(folder, shipped), request(tmp_path, tmp_path / "begin.npz"))


def test_a_run_begins_with_what_the_policy_answers(run, shipped):
    seen = torch.randn(16, 720, generator=torch.Generator().manual_seed(2)) * 0.3 + torch.from_numpy(shipped["mean"])
    actor = run.algorithm.get_policy().eval()
    with torch.no_grad():
        value = (seen - actor.obs_normalizer._mean) / (actor.obs_normalizer._std + actor.obs_normalizer.eps)
        answered = actor.mlp(value)
    torch.testing.assert_close(answered, act(shipped, seen), rtol=1e-4, atol=1e-4)


def test_the_critic_learns_alone_at_first(run):
    """Its preset's 60 iterations are not over after two; with none the actor learns at once."""
    networks = {"actor": run.algorithm._raw_actor.mlp, "critic": run.algorithm._raw_critic.mlp}
    before = {name: [value.clone() for value in network.parameters()] for name, network in networks.items()}

    def same(name: str) -> bool:
        return all(torch.equal(*pair) for pair in zip(before[name], networks[name].parameters(), strict=True))

    run.train()
    assert same("actor") and not same("critic")
    options = run.request.options
    assert run.algorithm.learning_rate == pytest.approx(options.learning_rate)
    rates = [group["lr"] for group in run.algorithm.optimizer.param_groups]
    assert rates == pytest.approx([options.learning_rate, options.critic_rate])
    run.algorithm._options = run.algorithm._options.changed(critic_iterations=0)
    run.request = dataclasses.replace(run.request, iterations=3)
    run.train()
    assert not same("actor")
    rates = [group["lr"] for group in run.algorithm.optimizer.param_groups]
    assert rates == pytest.approx([run.algorithm.learning_rate, options.critic_rate])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"joint_names": None}, "lacks joint_names"),
        ({"L1_w": None}, "lacks L1_w"),
        ({"L0_w": np.zeros((16, 720))}, "'L0_w' is \\(16, 720\\)"),
        ({"kp": "3 twice"}, "kp of '.*' is"),
        ({"joint_names": "turned round"}, "another order"),
        ({"kd": np.ones(5)}, r"kd is \(5,\)"),
        ({"L1_b": np.full(256, np.nan)}, "'L1_b' is not of finite numbers"),
        ({"eps": np.zeros(2)}, "'eps' is"),
    ],
)
def test_a_file_that_does_not_fit_is_refused(folder, shipped, tmp_path, change, told):
    arrays = dict(shipped)
    for name, value in change.items():
        if value is None:
            del arrays[name]
        elif name == "kp":
            arrays["kp"] = shipped["kp"] * np.where(np.arange(len(shipped["kp"])) == 3, 2.0, 1.0)
        elif name == "joint_names":
            arrays["joint_names"] = shipped["joint_names"][::-1]
        else:
            arrays[name] = value
    path = tmp_path / "wrong.npz"
    write_policy(path, arrays)
    with pytest.raises(TrainingError, match=told) as error:
        TrainingRun(bundle_for(folder, shipped), request(tmp_path, path))
    assert str(path) in str(error.value)


def test_garbage_is_refused_by_the_command(folder, tmp_path, capsys):
    path = tmp_path / "garbage.npz"
    path.write_bytes(b"no archive")
    common = ["--bundle", str(folder), "--out", str(tmp_path / "run"), "--device", "cpu", "--num-envs", "2"]
    sets = [f"--set={name}={value}" for name, value in SMALL.items()]
    assert main([*common, *sets, "--preset", "refined_steps", "--start-from", str(path)]) == 2
    assert str(path) in capsys.readouterr().err
    assert main([*common, *sets, "--preset", "refined_steps", "--start-from", str(tmp_path / "none.npz")]) == 2
    assert "none.npz" in capsys.readouterr().err
    assert newest_checkpoint(tmp_path / "run" / "checkpoints") is None


def test_a_given_normalizer_hardly_moves(run, shipped):
    """It has seen as much as in a run of 20 minutes; a new one would be the first batch's own at once."""
    run.train()
    moved = run.algorithm.get_policy().obs_normalizer._mean.ravel().numpy() - shipped["mean"]
    assert 0.0 < np.abs(moved / (shipped["std"] + shipped["eps"])).max() < 1e-3


def test_the_actor_begins_at_a_small_rate_also_where_the_run_was_left_before(folder, shipped, tmp_path):
    write_policy(tmp_path / "begin.npz", shipped)
    rates: list[float] = []
    alone = 0
    for iterations in (2, 3):
        asked = request(tmp_path, tmp_path / "begin.npz", critic_iterations=2)
        asked = dataclasses.replace(asked, iterations=iterations, resume=iterations > 2)
        run = TrainingRun(bundle_for(folder, shipped), asked)
        run.algorithm.optimizer.register_step_pre_hook(lambda each, *_: rates.append(each.param_groups[0]["lr"]))
        alone = len(rates)
        run.train()
    assert rates[0] == pytest.approx(1e-3)
    assert FIRST_RATE <= rates[alone] <= 1.5 * FIRST_RATE


def test_a_run_keeps_what_it_began_with(folder, shipped, tmp_path):
    write_policy(tmp_path / "begin.npz", shipped)
    asked = request(tmp_path, tmp_path / "begin.npz")
    TrainingRun(bundle_for(folder, shipped), asked).train()
    config = tmp_path / "config.json"
    begun = json.loads(config.read_text())["start_from"]
    assert begun == hashlib.sha256((tmp_path / "begin.npz").read_bytes()).hexdigest()
    again = dataclasses.replace(asked, start_from=None, resume=True, iterations=3)
    TrainingRun(bundle_for(folder, shipped), again).train()
    assert json.loads(config.read_text())["start_from"] == begun
    write_policy(tmp_path / "other.npz", {**shipped, "L3_b": shipped["L3_b"] + 0.1})
    other = dataclasses.replace(again, start_from=tmp_path / "other.npz", iterations=4)
    with pytest.raises(TrainingError, match=r"other\.npz: is not what the run"):
        TrainingRun(bundle_for(folder, shipped), other).train()


def test_a_policy_needs_a_critic_and_a_lonely_critic_a_policy(folder, shipped, tmp_path):
    write_policy(tmp_path / "begin.npz", shipped)
    with pytest.raises(TrainingError, match="has no critic"):
        TrainingRun(bundle_for(folder, shipped), request(tmp_path, tmp_path / "begin.npz", critic_iterations=0))
    with pytest.raises(TrainingError, match="'critic_iterations' is 60"):
        TrainingRun(bundle_for(folder, shipped), request(tmp_path, None))


@pytest.mark.parametrize("half", [["--share", "0.1"], ["--towards", "begin.npz"]])
def test_half_of_what_mixes_two_policies_is_refused(folder, tmp_path, capsys, half):
    asked = [
        "--checkpoint",
        str(tmp_path / "model_000100.pt"),
        "--bundle",
        str(folder),
        "--out",
        str(tmp_path / "p.npz"),
    ]
    assert export([*asked, *half]) == 2
    assert "give both or neither" in capsys.readouterr().err


def test_a_policy_is_moved_towards_another(folder, shipped, tmp_path):
    """The command, between a checkpoint and the policy it went on from: a quarter of the way, layer by layer."""
    write_policy(tmp_path / "begin.npz", shipped)
    robot = bundle_for(folder, shipped).robot
    own = {name: value + 0.4 if name.startswith("L") else value for name, value in shipped.items()}
    mixed = moved_towards(own, tmp_path / "begin.npz", 0.25, robot)
    for name, value in shipped.items():
        if name == "joint_names":
            assert (mixed[name] == value).all()
        else:
            np.testing.assert_allclose(mixed[name], value + 0.3 * name.startswith("L"), rtol=1e-6, atol=1e-6)
    assert mixed["L0_w"].dtype == shipped["L0_w"].dtype
    for share, changed, told in (
        (1.5, {}, "--share is 1.5; it must be 0 to 1"),
        (0.5, {"L1_b": np.zeros(7)}, r"'L1_b' is not \(256,\)"),
        (0.5, {"kp": np.ones(23)}, "kp of '.*' is 1"),
    ):
        write_policy(tmp_path / "other.npz", {**shipped, **changed})
        with pytest.raises(TrainingError, match=told):
            moved_towards(own, tmp_path / "other.npz", share, robot)


def test_a_shortage_of_memory_is_not_called_damage(tmp_path, monkeypatch):
    def short(*_, **__):
        raise MemoryError

    monkeypatch.setattr(np, "load", short)
    with pytest.raises(TrainingError, match=r"policy\.npz: needs more memory than is free"):
        arrays_of(tmp_path / "policy.npz")
