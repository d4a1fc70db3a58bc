"""Weighted sums of policies: exact where the answer is known, and refused where they are of different robots."""

from __future__ import annotations

import json
import shlex

import numpy as np
import pytest

from pipeline.learning.policy_file import write_policy
from pipeline.learning.training_error import TrainingError
from pipeline.training.mix_policies import main, mixed


def policy(seed: int, **changed) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    arrays = {
        "mean": rng.normal(size=6).astype(np.float32),
        "std": rng.uniform(0.5, 1.0, 6).astype(np.float32),
        "eps": np.array(0.01),
        "L0_w": rng.normal(size=(4, 6)).astype(np.float32),
        "L0_b": rng.normal(size=4).astype(np.float32),
        "kp": np.full(2, 100.0),
        "kd": np.full(2, 2.0),
        "default_joint_pos": np.zeros(2),
        "joint_names": np.array(["Left_Knee_Pitch", "Right_Knee_Pitch"]),
    }
    return arrays | changed


@pytest.fixture
def written(tmp_path):
    def write(name, arrays):
        write_policy(tmp_path / name, arrays)
        return tmp_path / name

    return write


def test_a_linear_network_answers_the_sum_of_answers(written):
    """With one normalizer a single layer is linear in its numbers: weights may be negative."""
    one, other = policy(1), policy(2)
    other |= {name: one[name] for name in ("mean", "std")}
    sum_of = mixed([(1.25, written("one.npz", one)), (-0.25, written("other.npz", other))])
    seen = np.random.default_rng(3).normal(size=(5, 6))
    expected = 1.25 * (seen @ one["L0_w"].T + one["L0_b"]) - 0.25 * (seen @ other["L0_w"].T + other["L0_b"])
    np.testing.assert_allclose(seen @ sum_of["L0_w"].T + sum_of["L0_b"], expected, atol=1e-6)
    assert sum_of["L0_w"].dtype == np.float32


def test_the_policy_that_ships_is_made_again_to_the_byte(root, tmp_path):
    """By the command in its own card."""
    folder = root / "robots" / "t1" / "policies" / "walk"
    words = shlex.split(json.loads((folder / "card.json").read_text())["run"]["command"].replace("'", ""))
    first = words.index("pipeline.training.mix_policies") + 1
    arguments = [word.rstrip(";.") for word in words[first : words.index("--out", first)]]
    arguments = [str(root / word) if word.endswith(".npz") else word for word in arguments]
    assert arguments.count("--part") == 3
    assert main([*arguments, "--out", str(tmp_path / "policy.npz")]) == 0
    assert (tmp_path / "policy.npz").read_bytes() == (folder / "policy.npz").read_bytes()


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"kp": np.full(2, 80.0)}, "'kp' differs"),
        ({"joint_names": np.array(["Left_Knee_Pitch", "Waist"])}, "'joint_names' differs"),
        ({"L0_b": np.zeros(3, dtype=np.float32)}, r"'L0_b' is \(3,\)"),
        ({"L1_w": np.zeros((2, 4), dtype=np.float32)}, "which arrays it has: L1_w"),
        ({"L0_w": np.full((4, 6), np.nan, dtype=np.float32)}, "not of finite numbers"),
    ],
)
def test_a_policy_unlike_the_first_is_refused_by_name(written, changed, told):
    parts = [(0.5, written("one.npz", policy(1))), (0.5, written("unlike.npz", policy(2, **changed)))]
    with pytest.raises(TrainingError, match=f"unlike.npz: .*{told}"):
        mixed(parts)


@pytest.mark.parametrize(
    ("weights", "told"),
    [
        (("0.5", "0.4"), "sum to 0.9"),
        (("half", "0.5"), "--part half"),
        (("nan", "1"), "--part nan"),
        (("9", "-8"), "0 or less"),
    ],
)
def test_weights_that_cannot_be_are_told_and_nothing_is_written(written, tmp_path, capsys, weights, told):
    files = [written("one.npz", policy(1)), written("other.npz", policy(2))]
    parts = [word for weight, path in zip(weights, files, strict=True) for word in ("--part", weight, str(path))]
    assert main([*parts, "--out", str(tmp_path / "out.npz")]) == 2
    assert told in capsys.readouterr().err
    assert not (tmp_path / "out.npz").exists()
