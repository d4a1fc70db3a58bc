"""The trained network as numbers, in the form that `pipeline.deployment.load_policy` reads."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from pipeline.learning.robot_facts import RobotFacts
from pipeline.learning.training_error import TrainingError

EPS = 1e-2
"""rsl-rl's normalizer adds it to the standard deviation."""


def policy_arrays(state: dict[str, Any], robot: RobotFacts) -> dict[str, np.ndarray]:
    """`mean, std, eps`, layers `L0_w, L0_b, …` and the gains, of a checkpoint's `actor_state_dict`.

    Raises TrainingError where that is another network's.
    """
    try:
        return _policy_arrays(state, robot)
    except (KeyError, ValueError, IndexError, AttributeError, TypeError) as error:
        raise TrainingError(
            f"the checkpoint's actor is no network of ours ({type(error).__name__}: {error})."
        ) from error


def _policy_arrays(state: dict[str, Any], robot: RobotFacts) -> dict[str, np.ndarray]:
    actor = {name: value.detach().cpu().numpy() for name, value in state["actor_state_dict"].items()}
    arrays = {
        "mean": actor["obs_normalizer._mean"].ravel(),
        "std": actor["obs_normalizer._std"].ravel(),
        "eps": np.array(EPS),
    }
    layers = sorted({int(name.split(".")[1]) for name in actor if name.startswith("mlp.")})
    for number, layer in enumerate(layers):
        arrays |= {f"L{number}_w": actor[f"mlp.{layer}.weight"], f"L{number}_b": actor[f"mlp.{layer}.bias"]}
    gains = {"kp": robot.kp, "kd": robot.kd, "default_joint_pos": robot.default_joint_pos}
    return {**arrays, **gains, "joint_names": np.array(robot.joint_names)}


def mean_arrays(each: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """The mean of policies of one form: normalizer and layers; gains are the first one's."""
    kept = ("eps", "kp", "kd", "default_joint_pos", "joint_names")
    first = each[0]
    return {
        name: value if name in kept or len(each) == 1 else np.mean([one[name] for one in each], axis=0)
        for name, value in first.items()
    }


def summed_names(arrays: dict[str, np.ndarray]) -> list[str]:
    """The arrays of a policy that are its network: normalizer and layers."""
    return [name for name in arrays if name in ("mean", "std") or name.startswith("L")]


def weighted_sum(parts: Sequence[tuple[float, dict[str, np.ndarray]]]) -> dict[str, np.ndarray]:
    """The weighted sum of policies of one form, in the order given; what is no network is the first one's."""
    first = parts[0][1]
    sums = {name: sum(weight * each[name].astype(np.float64) for weight, each in parts) for name in summed_names(first)}
    return {**first, **{name: value.astype(first[name].dtype) for name, value in sums.items()}}


def act(arrays: dict[str, np.ndarray], observation: torch.Tensor) -> torch.Tensor:
    """The action of a policy file for observations (n, o), in torch."""
    tensors = {name: torch.from_numpy(np.asarray(arrays[name])).float() for name in arrays if name != "joint_names"}
    value = (observation - tensors["mean"]) / (tensors["std"] + tensors["eps"])
    count = sum(name.startswith("L") and name.endswith("_w") for name in tensors)
    for number in range(count):
        value = value @ tensors[f"L{number}_w"].T + tensors[f"L{number}_b"]
        value = torch.nn.functional.elu(value) if number < count - 1 else value
    return value


def write_policy(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write the arrays as an npz, whole or not at all; equal arrays give equal bytes."""
    stream = io.BytesIO()
    np.savez(stream, **arrays)  # pyright: ignore[reportArgumentType]
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    part.write_bytes(stream.getvalue())
    part.replace(path)
