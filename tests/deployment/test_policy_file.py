"""A policy as numbers: the published one's examples, round trips, files that are none."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline.deployment import Policy, deployment_task, digest, load_policy, save_policy
from pipeline.deployment.policy import Golden
from pipeline.errors import FileError
from pipeline.robot import Robot
from tests.factories.policies import random_policy

GAINS = {"joint_names": np.array(["a", "b"]), "kp": np.ones(2), "kd": np.ones(2), "default_joint_pos": np.zeros(2)}


@pytest.fixture
def policy(robot: Robot) -> Policy:
    return random_policy(deployment_task(robot), np.random.default_rng(3), gains=True)


@pytest.mark.shared
def test_the_published_policy_gives_its_published_actions(policies: Path):
    policy = load_policy(policies / "t1_walk.npz")
    assert policy.golden is not None
    np.testing.assert_allclose(policy.act(policy.golden.observation), policy.golden.action, atol=1e-5)
    assert len(policy.golden.action) == 5
    assert policy.gains is None


def test_a_policy_is_two_affine_maps_with_an_elu_between():
    first, second = np.array([[1.0, 0.0], [0.0, -1.0]]), np.array([[2.0, 3.0]])
    layers = ((first, np.array([0.5, 0.0])), (second, np.array([-1.0])))
    policy = Policy(mean=np.array([1.0, 2.0]), scale=np.array([2.0, 4.0]), layers=layers)
    seen = np.array([3.0, 10.0])  # normalised 1 and 2, so 1.5 and exp(-2) - 1 behind the ELU
    np.testing.assert_allclose(policy.act(seen), [2.0 * 1.5 + 3.0 * np.expm1(-2.0) - 1.0])
    np.testing.assert_allclose(policy.act(np.tile(seen, (4, 1))), np.tile(policy.act(seen), (4, 1)))


def test_what_is_saved_is_loaded_with_all_that_travels_with_it(tmp_path: Path, policy: Policy):
    observation = np.random.default_rng(1).normal(size=(3, policy.observation_size))
    policy = dataclasses.replace(policy, golden=Golden(observation=observation, action=policy.act(observation)))
    save_policy(tmp_path / "a.npz", policy)
    loaded = load_policy(tmp_path / "a.npz")
    assert digest(loaded) == digest(policy)
    assert loaded.gains is not None and policy.gains is not None
    assert loaded.gains.joint_names == policy.gains.joint_names
    np.testing.assert_array_equal(loaded.gains.kd, policy.gains.kd)
    np.testing.assert_array_equal(loaded.act(observation), policy.act(observation))
    save_policy(tmp_path / "b.npz", loaded)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_the_digest_sees_one_weight_and_one_gain(policy: Policy):
    weight, bias = policy.layers[0]
    moved = weight.copy()
    moved[2, 5] += 1e-12
    assert digest(dataclasses.replace(policy, layers=((moved, bias), *policy.layers[1:]))) != digest(policy)
    assert policy.gains is not None
    gains = dataclasses.replace(policy.gains, kd=2.0 * policy.gains.kd)
    assert digest(dataclasses.replace(policy, gains=gains)) != digest(policy)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"eps": None}, "lacks the arrays eps"),
        ({"L0_w": None, "L0_b": None}, "lacks the arrays L0_w, L0_b"),
        ({"L0_w": np.ones((2, 5))}, "do not match each other"),
        ({"L0_b": np.array([0.0, np.nan])}, "not finite in L0_b"),
        ({"std": np.zeros(4), "eps": np.array(0.0)}, "std that is not above 0"),
        ({"std": np.ones(3)}, "a mean of shape"),
        ({"kp": np.ones(2)}, "only some of the arrays"),
        ({"golden_action": np.ones((1, 2))}, "do not fit its layers"),
        ({**GAINS, "kp": np.array([1.0, -1.0])}, "a kp or kd below 0"),
        ({**GAINS, "default_joint_pos": np.array([-71.6, 0.0])}, "of 71.6 rad; .* Convert degrees to radians"),
    ],
)
def test_a_policy_file_that_is_none_is_refused(tmp_path: Path, change: dict, match: str):
    arrays = {
        "mean": np.zeros(4),
        "std": np.ones(4),
        "eps": np.array(0.1),
        "L0_w": np.ones((2, 4)),
        "L0_b": np.zeros(2),
    }
    kept = {name: value for name, value in (arrays | change).items() if value is not None}
    np.savez(tmp_path / "policy.npz", **kept)
    with pytest.raises(FileError, match=match):
        load_policy(tmp_path / "policy.npz")


@pytest.mark.parametrize("content", [b"not numbers", b"", b"PK\x03\x04 cut off"])
def test_a_file_of_another_kind_is_refused(tmp_path: Path, content: bytes):
    path = tmp_path / "policy.npz"
    path.write_bytes(content)
    with pytest.raises(FileError, match="is not an npz of numbers"):
        load_policy(path)
    np.save(tmp_path / "array.npy", np.ones(3))
    with pytest.raises(FileError, match="is not an npz of numbers"):
        load_policy(tmp_path / "array.npy")
    with pytest.raises(FileError, match="no such file"):
        load_policy(tmp_path / "none.npz")
