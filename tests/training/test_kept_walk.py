"""Staying near a policy that is gone on with, as it is told ahead or as it is unpushed."""

from __future__ import annotations

import copy
import csv
import dataclasses

import numpy as np
import pytest
import torch
from tensordict import TensorDict
from torch import nn

from pipeline.learning.policy_file import act, write_policy
from pipeline.learning.training_error import TrainingError
from pipeline.training.amp_ppo import quick_products
from pipeline.training.bundle import read_bundle
from pipeline.training.kept_walk import KeptWalk, ahead, share_kept
from pipeline.training.mirror import MirroredSamples
from pipeline.training.presets import preset
from pipeline.training.run import RunRequest, TrainingRun
from tests.factories.training_bundle import small_bundle

SMALL = {"expert_windows": 200, "replay_windows": 200, "discriminator_batch": 32, "discriminator_steps": 2, "steps": 4}
WALK, TURN = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("command", "share"),
    [
        (WALK, 1.0),
        ((2.0, 0.0, -0.5), 1.0),
        ((0.3, 0.0, 0.0), 0.5),
        ((0.6, -0.3, 0.0), 0.5),
        ((0.6, 0.0, -1.0), 0.5),
        ((-0.6, 0.0, 0.0), 0.0),
        ((0.0, 0.6, 0.0), 0.0),
        (TURN, 0.0),
        ((0.0, 0.0, 0.0), 0.0),
    ],
)
def test_what_is_ahead(command, share):
    assert ahead(torch.tensor([command])).item() == pytest.approx(share)


class Linear(nn.Module):
    """Actions of two numbers from what the actor sees."""

    def __init__(self):
        super().__init__()
        self.layer = nn.Linear(720, 2)

    def forward(self, obs):
        return self.layer(obs["actor"])


def seen(*commands) -> TensorDict:
    """Observations (n,) with these newest commands, and another in all older frames."""
    frames = torch.randn(len(commands), 10, 72, generator=torch.Generator().manual_seed(3))
    frames[:, :, 6:9] = torch.tensor((0.4, 0.4, 0.4))
    frames[:, -1, 6:9] = torch.tensor(commands)
    return TensorDict({"actor": frames.flatten(1)}, batch_size=[len(commands)])


def test_it_is_the_divergence_of_equal_deviations_of_those_who_are_told_ahead():
    actor, obs = Linear(), seen(WALK, TURN)
    kept = KeptWalk(actor, std=0.2, weight=3.0)
    mean = actor(obs).detach() + torch.tensor([[0.1, -0.3], [5.0, 5.0]])
    given, now = (torch.distributions.Normal(at[0], 0.2) for at in (actor(obs), mean))
    divergence = torch.distributions.kl_divergence(now, given).sum()
    assert kept.loss(mean, obs).item() == pytest.approx(3.0 * divergence.item() / 2.0, rel=1e-5)


def test_or_of_those_whom_nobody_pushed_lately():
    actor, obs = Linear(), seen(TURN, WALK)
    obs["critic"] = torch.tensor([[9.0, 0.0], [0.0, 0.01]])
    kept = KeptWalk(actor, std=0.5, weight=3.0, of="unpushed")
    mean = actor(obs).detach() + torch.tensor([[0.1, -0.3], [5.0, 5.0]])
    assert kept.loss(mean, obs).item() == pytest.approx(3.0 * (0.1**2 + 0.3**2) / (2.0 * 0.5**2) / 2.0, rel=1e-5)


def test_the_actor_that_is_kept_stays_as_it_was():
    actor, obs = Linear(), seen(WALK)
    before = copy.deepcopy(actor)
    kept = KeptWalk(actor, std=0.2, weight=1.0)
    with torch.no_grad():
        actor.layer.bias += 0.3
    assert kept.loss(before(obs), obs).item() == 0.0
    loss = kept.loss(actor(obs), obs)
    loss.backward()
    uphill = actor.layer.bias.grad
    assert loss.item() > 0.0 and uphill is not None and (uphill > 0.0).all()


@pytest.fixture(scope="module")
def shipped(root):
    with np.load(root / "robots/t1/policies/walk/policy.npz", allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


@pytest.fixture(scope="module")
def bundle(tmp_path_factory, root, robot, shipped):
    read = read_bundle(small_bundle(tmp_path_factory.mktemp("training"), root, robot))
    gains = {name: np.asarray(shipped[name], dtype=float) for name in ("kp", "kd", "default_joint_pos")}
    return dataclasses.replace(read, robot=dataclasses.replace(read.robot, **gains))


def made(bundle, out, policy, iterations: int = 6, resume: bool = False, **changed) -> TrainingRun:
    options = preset("refined_steps").changed(**SMALL, **{"critic_iterations": 1, "desired_kl": 0.05, **changed})
    request = RunRequest(
        out=out,
        preset="refined_steps",
        options=options,
        num_envs=8,
        device="cpu",
        seed=1,
        iterations=iterations,
        minutes=None,
        resume=resume,
        start_from=policy,
    )
    return TrainingRun(bundle, request)


def strayed(run: TrainingRun, command) -> float:
    """How far a run's actor is from where it began, for observations with that command."""
    actor, obs = run.algorithm.get_policy(), seen(*[command] * 64)
    obs["actor"] = obs["actor"] * 0.3
    obs["actor"].unflatten(1, (10, -1))[:, :, 6:9] = torch.tensor(command)
    before = actor(obs).detach()
    run.train()
    return (actor(obs).detach() - before).square().mean().item()


def test_a_run_that_keeps_its_walk_strays_less_ahead(bundle, shipped, tmp_path):
    write_policy(tmp_path / "begin.npz", shipped)
    free = strayed(made(bundle, tmp_path / "free", tmp_path / "begin.npz", keep=0.0), WALK)
    held = strayed(made(bundle, tmp_path / "held", tmp_path / "begin.npz", keep=1000.0), WALK)
    assert held < 0.5 * free


def test_what_is_kept_is_what_the_run_began_with_also_where_it_goes_on(bundle, shipped, tmp_path):
    path = tmp_path / "begin.npz"
    write_policy(path, shipped)
    made(bundle, tmp_path / "run", path, keep=0.1, iterations=3).train()
    run = made(bundle, tmp_path / "run", path, keep=0.1, iterations=4, resume=True)
    obs, symmetry = seen(WALK, TURN), run.algorithm.symmetry
    assert isinstance(symmetry, MirroredSamples) and symmetry.kept is not None
    kept = symmetry.kept._actor(obs)
    torch.testing.assert_close(kept, act(shipped, obs["actor"]), rtol=1e-3, atol=1e-3)
    assert (run.algorithm.get_policy()(obs) - kept).abs().max() > 1e-4
    run.train()
    rows = csv.DictReader((tmp_path / "run" / "curves.csv").read_text().splitlines())
    alone, *strayed_by = [float(row["kept"]) for row in rows]
    assert alone < 1e-6 < 1e-4 < max(strayed_by), "nobody strays while the critic learns alone"


def test_the_critic_is_told_last_of_a_push_that_was(bundle, shipped, tmp_path):
    write_policy(tmp_path / "begin.npz", shipped)
    changed = {"push_interval_s": (0.1, 0.2), "push_impulse": (20.0, 20.0), "recovery_s": 0.06, "quiet_share": 0.5}
    env = made(bundle, tmp_path / "run", tmp_path / "begin.npz", keep=0.1, keep_of="unpushed", **changed).env
    env.reset()
    told = []
    for _ in range(20):
        seen_now = env.step(torch.zeros_like(env.action_manager.action))[0]["critic"]
        since_s = torch.stack([coming.since_s for coming in env.coming_pushes]).amin(dim=0)
        kept = share_kept("unpushed", TensorDict({"critic": seen_now}, batch_size=[8]))
        torch.testing.assert_close(kept, (since_s > 0.05 + 1e-6).float())
        told.append(kept)
    assert 0.0 < torch.stack(told).mean() < 1.0


@pytest.mark.parametrize(
    ("changed", "resume", "told"),
    [
        ({"keep": 0.1, "critic_iterations": 0}, False, "name it by --start-from"),
        ({"keep": 0.1}, True, "also with --resume"),
        ({"keep": 0.1, "symmetry": False}, False, "'keep' needs option 'symmetry'"),
        ({"keep": 0.1, "keep_of": "unpushed", "foresight": False}, False, "it needs 'recovery_s' and 'foresight'"),
        ({"keep": -1.0}, False, "'keep' is -1; it must be 0 or more"),
        ({"keep": float("nan")}, False, "'keep' is nan; it must be 0 or more"),
    ],
)
def test_there_must_be_a_policy_to_keep_and_a_way_to(bundle, tmp_path, changed, resume, told):
    with pytest.raises(TrainingError, match=told):
        made(bundle, tmp_path, None, resume=resume, **changed)


def test_on_a_processor_products_of_the_networks_are_not_rounded():
    generator = torch.Generator().manual_seed(3)
    one, other = torch.randn(64, 720, generator=generator), torch.randn(720, 512, generator=generator)
    before = torch.get_float32_matmul_precision()
    with quick_products("cpu"):
        product = one @ other
    assert (product - (one.double() @ other.double())).abs().max() < 1e-3
    assert torch.get_float32_matmul_precision() == before
