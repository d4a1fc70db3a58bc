"""The trained network as numbers, in the form that `pipeline.deployment.load_policy` reads."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from pipeline.files import atomic
from pipeline.learning.robot_facts import RobotFacts
from pipeline.learning.training_error import TrainingError

EPS = 1e-2
"""rsl-rl's normalizer adds it to the standard deviation."""


def policy_arrays(state: dict[str, Any], robot: RobotFacts) -> dict[str, np.ndarray]:
    """`mean, std, eps`, layers `L0_w, L0_b, …` and the gains, of a checkpoint's `actor_state_dict`.

    Weights are in half precision, which halves the file: each is rounded by 5e-4 of itself, or by 3e-8 where that is
    more; actions change by 1e-3 [action] or less (root mean square). Policies and trackers are measured as they are
    stored.

    Raises TrainingError where that is another network's, or a weight is too large for half precision.
    """
    try:
        actor = {name: value.detach().cpu().numpy() for name, value in state["actor_state_dict"].items()}
        arrays = {name: actor[f"obs_normalizer._{name}"].ravel() for name in ("mean", "std")} | {"eps": np.array(EPS)}
        layers = sorted({int(name.split(".")[1]) for name in actor if name.startswith("mlp.")})
        for number, layer in enumerate(layers):
            weight, bias = (actor[f"mlp.{layer}.{part}"] for part in ("weight", "bias"))
            arrays |= {f"L{number}_w": _halved(weight), f"L{number}_b": bias}
    except (KeyError, ValueError, IndexError, AttributeError, TypeError) as error:
        problem = f"the checkpoint's actor is no network of ours ({type(error).__name__}: {error})."
        raise TrainingError(problem) from error
    gains = {"kp": robot.kp, "kd": robot.kd, "default_joint_pos": robot.default_joint_pos}
    return {**arrays, **gains, "joint_names": np.array(robot.joint_names)}


def _halved(weight: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore"):
        halved = weight.astype(np.float16)
    if not np.isfinite(halved).all():
        raise TrainingError(f"the network has a weight of {np.abs(weight).max():g}: the training diverged.")
    return halved


class Network:
    """The network of a policy file in torch."""

    def __init__(self, arrays: Mapping[str, np.ndarray], device: str):
        def tensor(name: str) -> torch.Tensor:
            return torch.from_numpy(np.asarray(arrays[name])).float().to(device)

        self._mean, self._scale = tensor("mean"), tensor("std") + tensor("eps")
        count = sum(name.startswith("L") and name.endswith("_w") for name in arrays)
        self._layers = [(tensor(f"L{number}_w"), tensor(f"L{number}_b")) for number in range(count)]

    def __call__(self, observation: torch.Tensor) -> torch.Tensor:
        """The action for observations (n, o)."""
        value = (observation - self._mean) / self._scale
        for weight, bias in self._layers[:-1]:
            value = torch.nn.functional.elu(value @ weight.T + bias)
        weight, bias = self._layers[-1]
        return value @ weight.T + bias


def write_policy(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write the arrays as an npz, whole or not at all; equal arrays give equal bytes."""
    stream = io.BytesIO()
    np.savez(stream, **arrays)  # pyright: ignore[reportArgumentType]
    atomic.write_bytes(path, stream.getvalue())
