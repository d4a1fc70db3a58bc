"""Checkpoints: the newest one, damage, foreign content, and shortage of disk or memory."""

from __future__ import annotations

import itertools
import pickle

import numpy as np
import pytest
import torch

from pipeline.deployment import load_policy
from pipeline.learning.checkpoint import load_checkpoint, newest_checkpoint, save_checkpoint
from pipeline.learning.policy_file import EPS, policy_arrays, write_policy
from pipeline.learning.training_error import TrainingError
from pipeline.training.bundle import read_bundle
from tests.factories.training_bundle import small_bundle

STATE = {"actor_state_dict": {"a": torch.ones(2)}, "critic_state_dict": {}, "optimizer_state_dict": {}}


def test_the_newest_checkpoint_is_the_one_of_most_iterations(tmp_path):
    assert newest_checkpoint(tmp_path) is None
    for iteration in (900, 1000, 100):
        save_checkpoint(tmp_path, iteration, STATE, iteration * 24)
    newest = newest_checkpoint(tmp_path)
    assert newest is not None
    state = load_checkpoint(newest, "cpu")
    assert (state["iteration"], state["environment_steps"]) == (1000, 24_000)


class _Planted:
    """Runs code where it is unpickled."""

    def __reduce__(self):
        return (open, ("planted", "w"))


def test_a_checkpoint_that_would_run_code_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "model_000100.pt"
    torch.save({**STATE, "iteration": _Planted(), "environment_steps": 0}, path)
    with pytest.raises(TrainingError, match="is not a checkpoint of this project and was not loaded"):
        load_checkpoint(path, "cpu")
    path.write_bytes(pickle.dumps(_Planted()))
    with pytest.raises(TrainingError, match="not loaded"):
        load_checkpoint(path, "cpu")
    assert not (tmp_path / "planted").exists()


def test_a_full_disk_gets_a_sentence_and_leaves_no_file(tmp_path, monkeypatch):
    def full(state, path):
        path.write_bytes(b"half")
        raise RuntimeError("unexpected pos 64 vs 0")

    monkeypatch.setattr(torch, "save", full)
    with pytest.raises(TrainingError, match=r"model_000100\.pt: could not be written \(unexpected pos 64 vs 0\)"):
        save_checkpoint(tmp_path, 100, dict(STATE), 0)
    assert not list(tmp_path.iterdir())


def test_a_checkpoint_that_is_not_there_is_not_called_damaged(tmp_path):
    with pytest.raises(TrainingError, match=r"gone\.pt: can't be read \(No such file"):
        load_checkpoint(tmp_path / "gone.pt", "cpu")


@pytest.mark.parametrize("error", [torch.OutOfMemoryError("CUDA out of memory. Tried 2 MiB\nmore"), MemoryError()])
def test_a_shortage_of_memory_is_not_called_damage(tmp_path, monkeypatch, error):
    def full(*_, **__):
        raise error

    path = save_checkpoint(tmp_path, 1, STATE, 24)
    monkeypatch.setattr(torch, "load", full)
    with pytest.raises(TrainingError, match=r"model_000001\.pt: cpu has too little free memory to load") as error_info:
        load_checkpoint(path, "cpu")
    assert "not a checkpoint of this project" not in str(error_info.value)


def test_a_truncated_checkpoint_gets_a_sentence_that_says_what_to_do(tmp_path):
    (tmp_path / "model_000100.pt").write_bytes(b"PK")
    with pytest.raises(TrainingError, match=r"model_000100\.pt: .* Remove the file and repeat the command"):
        load_checkpoint(tmp_path / "model_000100.pt", "cpu")


def test_a_file_of_other_contents_is_no_checkpoint(tmp_path):
    path = tmp_path / "model_000001.pt"
    torch.save({"weights": torch.ones(1)}, path)
    with pytest.raises(TrainingError, match="lacks actor_state_dict, critic_state_dict"):
        load_checkpoint(path, "cpu")


def test_a_damaged_checkpoint_gives_one_sentence_or_a_whole_state(tmp_path):
    """Truncated anywhere, or with bits flipped, which PyTorch reads without comparing checksums."""
    rng = np.random.default_rng(0)
    tensors = {"mlp.0.weight": torch.ones(4, 3), "std": torch.ones(2)}
    whole = save_checkpoint(tmp_path, 5, {name: dict(tensors) for name in STATE}, 120).read_bytes()
    path, refused = tmp_path / "model_000001.pt", 0
    cuts = [whole[:size] for size in np.linspace(0, len(whole) - 1, 60).astype(int)]
    flipped = []
    for count in (1, 8, 64) * 60:
        damaged = np.frombuffer(whole, dtype=np.uint8).copy()
        damaged[rng.integers(len(damaged), size=count)] ^= np.uint8(1 << rng.integers(8))
        flipped.append(damaged.tobytes())
    for content in (*cuts, *flipped, b"", b"PK", b"\x80\x02.", b"\x80\x04K\x01."):
        path.write_bytes(content)
        try:
            state = load_checkpoint(path, "cpu")
        except TrainingError as error:
            refused += 1
            assert "\n" not in str(error)
            assert str(path) in str(error)
        else:
            assert isinstance(state["iteration"], int)
            assert all(torch.equal(state[part][name], value) for part in STATE for name, value in tensors.items())
    assert refused > 150


@pytest.mark.parametrize(
    ("part", "value"), [("iteration", -1), ("iteration", "9"), ("actor_state_dict", torch.ones(1))]
)
def test_a_checkpoint_whose_parts_are_of_another_kind_is_refused(tmp_path, part, value):
    path = tmp_path / "model_000001.pt"
    torch.save({**STATE, "iteration": 1, "environment_steps": 24, part: value}, path)
    with pytest.raises(TrainingError, match=f"invalid {part}"):
        load_checkpoint(path, "cpu")


def test_a_checkpoint_of_another_network_becomes_no_policy(tmp_path, root, robot):
    facts = read_bundle(small_bundle(tmp_path, root, robot)).robot
    with pytest.raises(TrainingError, match=r"actor is not a network of this project \(KeyError"):
        policy_arrays({"actor_state_dict": {"weights": torch.ones(2)}}, facts)


def _actor(robot) -> dict[str, torch.Tensor]:
    """A network of the recipe's size, as rsl-rl names its parts."""
    torch.manual_seed(0)
    sizes = [720, 512, 256, 128, len(robot.policy_joints)]
    layers = [torch.nn.Linear(before, after) for before, after in itertools.pairwise(sizes)]
    normalizer = {"obs_normalizer._mean": torch.randn(1, 720), "obs_normalizer._std": torch.rand(1, 720) + 0.1}
    weights = {f"mlp.{2 * number}.weight": layer.weight for number, layer in enumerate(layers)}
    return normalizer | weights | {f"mlp.{2 * number}.bias": layer.bias for number, layer in enumerate(layers)}


def test_a_policy_file_in_half_precision_acts_as_its_checkpoint(tmp_path, root, robot):
    facts = read_bundle(small_bundle(tmp_path, root, robot)).robot
    actor = _actor(facts)
    write_policy(tmp_path / "policy.npz", policy_arrays({"actor_state_dict": actor}, facts))
    policy = load_policy(tmp_path / "policy.npz")
    mean, std = (actor[f"obs_normalizer._{name}"].double() for name in ("mean", "std"))
    observations = mean + std * torch.randn(200, 720, dtype=torch.float64)
    value = (observations - mean) / (std + EPS)
    for number in range(4):
        value = value @ actor[f"mlp.{2 * number}.weight"].double().T + actor[f"mlp.{2 * number}.bias"].double()
        value = torch.nn.functional.elu(value) if number < 3 else value
    expected = value.detach().numpy()
    off = policy.act(observations.numpy()) - expected
    assert 0.0 < np.sqrt(np.mean(off**2)) < 1e-3 * np.sqrt(np.mean(expected**2))
    assert (tmp_path / "policy.npz").stat().st_size < 1.2e6


def test_a_weight_beyond_half_precision_is_a_diverged_run(tmp_path, root, robot):
    facts = read_bundle(small_bundle(tmp_path, root, robot)).robot
    actor = _actor(facts)
    actor["mlp.2.weight"] = actor["mlp.2.weight"].detach() * 1e7
    with pytest.raises(TrainingError, match=r"a weight of [\d.e+]+: the training diverged"):
        policy_arrays({"actor_state_dict": actor}, facts)
