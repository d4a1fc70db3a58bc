"""A network to begin with: that of a policy file, so that training goes on from a policy whose checkpoint nobody kept.

A policy file has the actor alone. Its normalizer is taken as one that has seen SEEN samples, and stays as it is;
deviations are those of `init_std`, the critic is new, and learns alone at first (`critic_iterations`).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from pipeline.learning.policy_file import EPS, summed_names, weighted_sum
from pipeline.learning.robot_facts import RobotFacts
from pipeline.learning.training_error import TrainingError

SEEN = 10**12
"""So much that a run of 20 minutes, which sees some 10^8, adds nothing: the units in which a network is told what it
sees stay those that it was trained in. With 10^8 here a walk was led off while the critic learned alone: `kept` of
braced_steps grew to .06 in 80 iterations."""
CURE = "Train on a bundle of the robot that it was trained on, or take another policy."
GAINS = ("kp", "kd", "default_joint_pos")


def network_of(path: Path, robot: RobotFacts) -> dict[str, np.ndarray]:
    """The arrays of a policy file. Raises TrainingError where it is none, or is of another robot or other gains."""
    given = arrays_of(path)
    _hold_to_robot(path, given, robot)
    return given


def begin_with(actor: nn.Module, path: Path, robot: RobotFacts) -> None:
    """Let an actor answer as the policy of a file does.

    Raises TrainingError where the file is none, or is of another size, robot or gains.
    """
    given = network_of(path, robot)
    state = actor.state_dict()
    wanted = _sources(state)
    missing = [name for name in wanted.values() if name not in given]
    if missing:
        raise TrainingError(f"{path}: lacks {', '.join(missing)}; it is no policy of ours.")
    for name, source in wanted.items():
        value = torch.from_numpy(np.asarray(given[source], dtype=np.float32))
        if value.numel() != state[name].numel() or value.ndim not in (state[name].ndim, state[name].ndim - 1):
            raise TrainingError(
                f"{path}: '{source}' is {tuple(value.shape)}, where this network has {tuple(state[name].shape)}; "
                "option 'hidden' says which layers it has."
            )
        state[name] = value.reshape(state[name].shape)
    state["obs_normalizer._std"] = state["obs_normalizer._std"] + (float(given["eps"]) - EPS)
    state["obs_normalizer._var"] = torch.square(state["obs_normalizer._std"])
    state["obs_normalizer.count"] = torch.tensor(SEEN, dtype=torch.long)
    actor.load_state_dict(state)


def moved_towards(arrays: dict[str, np.ndarray], path: Path, share: float, robot: RobotFacts) -> dict[str, np.ndarray]:
    """A policy with `share` of the network of a file and the rest of its own; gains are its own.

    Between a network and the one that it was trained on from, networks walk, and some better than both: Wortsman et
    al., "Robust fine-tuning of zero-shot models", CVPR 2022. Raises TrainingError where the file is none, or is of
    another size, robot or gains.
    """
    if not 0.0 <= share <= 1.0:
        raise TrainingError(f"--share is {share:g}; it must be 0 to 1.")
    given = network_of(path, robot)
    for name in summed_names(arrays):
        if name not in given or np.shape(given[name]) != arrays[name].shape:
            raise TrainingError(
                f"{path}: '{name}' is not {arrays[name].shape} as in the checkpoint; take one of that network."
            )
    return weighted_sum([(1.0 - share, arrays), (share, given)])


def arrays_of(path: Path) -> dict[str, np.ndarray]:
    """The arrays of a policy file, of whatever robot. Raises TrainingError for what can't be read or isn't finite."""
    given = _read(path)
    _hold_to_numbers(path, given)
    return given


def _read(path: Path) -> dict[str, np.ndarray]:
    try:
        with np.load(path, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except OSError as error:
        raise TrainingError(f"{path}: can't be read ({error.strerror or error}). Name the npz of a policy.") from error
    except MemoryError as error:
        raise TrainingError(
            f"{path}: needs more memory than is free. End what else runs here, or take another file: this one may "
            "state wrong sizes."
        ) from error
    except Exception as error:  # a damaged archive raises whatever a parser on its way does
        raise TrainingError(f"{path}: is no npz of numbers ({error}).") from error


def _hold_to_numbers(path: Path, given: dict[str, np.ndarray]) -> None:
    for name, value in given.items():
        if name != "joint_names" and not (np.issubdtype(value.dtype, np.number) and np.isfinite(value).all()):
            raise TrainingError(f"{path}: '{name}' is not of finite numbers; take another policy.")
    if "eps" in given and given["eps"].size != 1:
        raise TrainingError(f"{path}: 'eps' is {given['eps'].shape}; it must be one number.")


def _sources(state: dict[str, Any]) -> dict[str, str]:
    """Which array of the file each tensor of the actor is."""
    layers = sorted({int(name.split(".")[1]) for name in state if name.startswith("mlp.")})
    wanted = {"obs_normalizer._mean": "mean", "obs_normalizer._std": "std"}
    for number, layer in enumerate(layers):
        wanted |= {f"mlp.{layer}.weight": f"L{number}_w", f"mlp.{layer}.bias": f"L{number}_b"}
    return wanted


def _hold_to_robot(path: Path, given: dict[str, np.ndarray], robot: RobotFacts) -> None:
    """Joints and gains are the robot's: another stiffness is another robot to a policy."""
    missing = [name for name in ("eps", "joint_names", *GAINS) if name not in given]
    if missing:
        raise TrainingError(f"{path}: lacks {', '.join(missing)}; training goes on from a policy with its gains alone.")
    names = tuple(str(name) for name in given["joint_names"])
    if names != tuple(robot.joint_names):
        raise TrainingError(
            f"{path}: is of the joints {', '.join(names)}; this robot's are in another order, or others. {CURE}"
        )
    for gain in GAINS:
        if np.shape(given[gain]) != np.shape(getattr(robot, gain)):
            raise TrainingError(f"{path}: {gain} is {given[gain].shape}; it must be a number for each joint.")
        off = ~np.isclose(np.asarray(given[gain], dtype=float), getattr(robot, gain), rtol=1e-6, atol=1e-9)
        if off.any():
            joint = int(np.flatnonzero(off)[0])
            wanted = getattr(robot, gain)[joint]
            told = f"{gain} of '{names[joint]}' is {given[gain][joint]:g}, the robot's {wanted:g}"
            raise TrainingError(f"{path}: {told}. {CURE}")
