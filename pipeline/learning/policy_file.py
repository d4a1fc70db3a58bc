"""The trained network as an npz that `pipeline.deployment.load_policy` reads."""

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
"""Added to the standard deviation by rsl_rl's normalizer."""


def policy_arrays(state: dict[str, Any], robot: RobotFacts) -> dict[str, np.ndarray]:
    """Arrays `mean, std, eps`, layers `L0_w, L0_b, …` and gains, from a checkpoint's `actor_state_dict`.

    Weights are stored in half precision, which halves the file. The rounding error is at most 5e-4 of a weight, or
    3e-8 if that is more; actions change by at most 1e-3 [action] (RMS). Policies and trackers are evaluated as stored.

    Raises TrainingError for another network, or a weight that is too large for half precision.
    """
    try:
        actor = {name: value.detach().cpu().numpy() for name, value in state["actor_state_dict"].items()}
        arrays = {name: actor[f"obs_normalizer._{name}"].ravel() for name in ("mean", "std")} | {"eps": np.array(EPS)}
        layers = sorted({int(name.split(".")[1]) for name in actor if name.startswith("mlp.")})
        for number, layer in enumerate(layers):
            weight, bias = (actor[f"mlp.{layer}.{part}"] for part in ("weight", "bias"))
            arrays |= {f"L{number}_w": _half_precision(weight), f"L{number}_b": bias}
    except (KeyError, ValueError, IndexError, AttributeError, TypeError) as error:
        problem = f"the checkpoint's actor is not a network of this project ({type(error).__name__}: {error})."
        raise TrainingError(problem) from error
    gains = {"kp": robot.kp, "kd": robot.kd, "default_joint_pos": robot.default_joint_pos}
    return {**arrays, **gains, "joint_names": np.array(robot.joint_names)}


def _half_precision(weight: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore"):
        halved = weight.astype(np.float16)
    if not np.isfinite(halved).all():
        raise TrainingError(f"the network has a weight of {np.abs(weight).max():g}: the training diverged.")
    return halved


class Network:
    """The network of a policy file in PyTorch."""

    def __init__(self, arrays: Mapping[str, np.ndarray], device: str):
        def tensor(name: str) -> torch.Tensor:
            return torch.from_numpy(np.asarray(arrays[name])).float().to(device)

        self._mean, self._scale = tensor("mean"), tensor("std") + tensor("eps")
        count = sum(name.startswith("L") and name.endswith("_w") for name in arrays)
        self._layers = [(tensor(f"L{number}_w"), tensor(f"L{number}_b")) for number in range(count)]

    def __call__(self, observation: torch.Tensor) -> torch.Tensor:
        """Actions (n, a) for observations (n, o)."""
        value = (observation - self._mean) / self._scale
        for weight, bias in self._layers[:-1]:
            value = torch.nn.functional.elu(value @ weight.T + bias)
        weight, bias = self._layers[-1]
        return value @ weight.T + bias


def write_policy(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write the arrays as an npz atomically; equal arrays give equal bytes."""
    stream = io.BytesIO()
    np.savez(stream, **arrays)  # pyright: ignore[reportArgumentType]
    atomic.write_bytes(path, stream.getvalue())
