"""Two processes over gloo: they take over the first one's networks, average gradients and figures, and stay equal."""

from __future__ import annotations

import multiprocessing
from pathlib import Path

import pytest
import torch
from torch import nn

from pipeline.training.amp.algorithm import AmpPpo
from pipeline.training.amp.discriminator import Discriminator
from pipeline.training.bundle import read_bundle
from pipeline.training.config import RECIPE
from pipeline.training.runner import AmpStage
from pipeline.training.stage import Request
from tests.factories.training_bundle import small_bundle

WORLD = 2
SMALL = RECIPE.changed({"simulation.num_envs": 16, "discriminator.frames": 3}).discriminator
FEATURES = 6


def work(rank: int, folder: str) -> None:
    """What one process does; its networks and figures go to a file."""
    torch.distributed.init_process_group("gloo", init_method=f"file://{folder}/store", rank=rank, world_size=WORLD)
    torch.manual_seed(rank)
    algorithm = AmpPpo.__new__(AmpPpo)  # without an environment
    algorithm._raw_actor, algorithm._raw_critic, algorithm.rnd = nn.Linear(2, 2), nn.Linear(2, 1), None
    algorithm.gpu_world_size = WORLD
    windows = torch.randn(64, 3, FEATURES) + 1.0
    algorithm.discriminator = Discriminator(windows, torch.full((FEATURES,), 0.01), SMALL, 16, "cpu")
    algorithm.broadcast_parameters()
    first = {name: value.clone() for name, value in algorithm.discriminator.network.state_dict().items()}
    weight = nn.Parameter(torch.zeros(3))
    weight.grad = torch.full((3,), float(rank + 1))
    algorithm._mean_gradients([weight, nn.Parameter(torch.zeros(1))])
    algorithm.discriminator.replay.insert(torch.randn(64, 3, FEATURES), torch.ones(64, dtype=torch.bool))
    for _ in range(3):
        algorithm.discriminator.update(algorithm._mean_gradients)
    state = {
        "first": first,
        "actor": algorithm._raw_actor.state_dict(),
        "discriminator": algorithm.discriminator.network.state_dict(),
        "gradient": weight.grad,
        "figures": algorithm.discriminator.figures,
    }
    torch.save(state, Path(folder) / f"{rank}.pt")
    torch.distributed.destroy_process_group()


def test_two_processes_train_one_discriminator(tmp_path):
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=work, args=(rank, str(tmp_path)), daemon=True) for rank in range(WORLD)]
    for process in processes:
        process.start()
    for process in processes:
        process.join(120)
    assert [process.exitcode for process in processes] == [0, 0]
    one, other = (torch.load(tmp_path / f"{rank}.pt", weights_only=True) for rank in range(WORLD))
    for part in ("first", "actor", "discriminator"):
        assert all(torch.equal(value, other[part][name]) for name, value in one[part].items()), part
    assert any(not torch.equal(value, one["discriminator"][name]) for name, value in one["first"].items())
    assert one["gradient"].tolist() == other["gradient"].tolist() == [1.5, 1.5, 1.5]
    assert one["figures"] == pytest.approx(other["figures"])


def test_each_process_draws_other_commands_and_states(tmp_path, root, robot, monkeypatch):
    bundle = read_bundle(small_bundle(tmp_path, root, robot))
    config = RECIPE.changed({"simulation.num_envs": 8})
    request = Request(out=tmp_path, preset="recipe", config=config, device="cpu", seed=1, physics="plain")
    drawn = []
    for rank in ("0", "1", "1"):
        monkeypatch.setenv("RANK", rank)
        env = AmpStage(bundle, request, tmp_path / "amp").env
        env.reset()
        drawn.append(torch.cat([env.command, env.sim.data.qpos[:, 7:]], dim=1).clone())
    first, second, again = drawn
    assert torch.equal(second, again), "a process draws by its number"
    assert (first != second).any(dim=1).all()
