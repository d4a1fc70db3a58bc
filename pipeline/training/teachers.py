"""Several policies that teach one network, each in its roles (`roles.py`): what they do at what the actor sees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch

from pipeline.learning.robot_facts import RobotFacts
from pipeline.learning.training_error import TrainingError
from pipeline.training.given_network import network_of
from pipeline.training.mirror import Mirror
from pipeline.training.observations import HISTORY
from pipeline.training.roles import ROLES, STANDS_IN
from pipeline.training.walked_speeds import WalkedSpeeds, corrected

MOST_BEYOND = 0.3
"""Largest share of `beyond`: with much more a teacher does what nobody taught it."""


def _taught(role: str, paths: Mapping[str, Path]) -> str:
    """The role whose teacher teaches a role."""
    while role not in paths:
        role = STANDS_IN.get(role, "other")
    return role


class Teachers:
    """The networks of policy files, by role."""

    def __init__(
        self,
        paths: Mapping[str, Path],
        robot: RobotFacts,
        device: str,
        walks: Mapping[str, str] | None = None,
        both_sides: Sequence[str] = (),
        with_error: Sequence[str] = (),
        beyond: Mapping[str, float] | None = None,
    ):
        """`walks`: how fast the teacher of a role walks as it is told (`walked_speeds.py`). `both_sides`: roles whose
        teacher answers as it and its mirror image do, on average, and so walks straight. `with_error`: roles whose
        teacher is told what the velocity lacks on top of the command. `beyond`: by which share of what the teacher of a
        role does otherwise than who teaches `pushed` it does more of it.

        Raises TrainingError for a role that is none, or is asked something of without a teacher of its own, without
        `other`, and for a file that is no policy for this robot, its gains and what its actor sees and does."""
        unknown = [role for role in paths if role not in ROLES]
        if unknown:
            raise TrainingError(f"--teacher names '{unknown[0]}'; roles are {', '.join(ROLES)}.")
        if "other" not in paths:
            raise TrainingError("--teacher other=POLICY is needed: who teaches where nobody else does.")
        for named, roles in (
            ("--walks", tuple(walks or {})),
            ("--both-sides", both_sides),
            ("--with-error", with_error),
            ("--beyond", tuple(beyond or {})),
        ):
            strangers = [role for role in roles if role not in paths]
            if strangers:
                raise TrainingError(f"{named} names '{strangers[0]}', which has no --teacher of its own.")
        _hold_to_shares(beyond or {}, "pushed" in paths)
        self._speeds = {role: WalkedSpeeds(text) for role, text in (walks or {}).items()}
        self._networks = {role: _Network(_teacher(path, robot), device) for role, path in paths.items()}
        self._mirrors = dict.fromkeys(both_sides, Mirror(robot, device) if both_sides else None)
        self._with_error = frozenset(with_error)
        self._beyond = dict(beyond or {})
        self._taken = torch.tensor([ROLES.index(_taught(role, paths)) for role in ROLES], device=device)

    def sloped(self, env) -> torch.Tensor | None:
        """Who (n,) walks on ground that slopes, where that has a teacher and ground slopes."""
        return None if "sloped" not in self._networks or env.slopes is None else ~env.slopes.level

    def act(self, observation: torch.Tensor, role: torch.Tensor, error: torch.Tensor | None = None) -> torch.Tensor:
        """What (n, a) the teachers of roles (n,) do at what the actor sees (n, o); `error`: by how much the command is
        over the averaged velocity (n, 3), for those who are corrected by it."""
        taken = self._taken[role]
        told = {name: self._answer(name, observation, error) for name in self._networks}
        told |= {name: torch.lerp(told[name], told["pushed"], -share) for name, share in self._beyond.items()}
        action = torch.full_like(next(iter(told.values())), torch.nan)
        for name, each in told.items():
            action = torch.where((taken == ROLES.index(name))[:, None], each, action)
        return action

    def _answer(self, role: str, seen: torch.Tensor, error: torch.Tensor | None) -> torch.Tensor:
        network = self._networks[role]
        seen = corrected(seen, error) if role in self._with_error and error is not None else seen
        seen = self._speeds[role].seen_as(seen) if role in self._speeds else seen
        mirror = self._mirrors.get(role)
        if mirror is None:
            return network(seen)
        return 0.5 * (network(seen) + mirror.actions(network(mirror.seen(seen))))


def _hold_to_shares(beyond: Mapping[str, float], pushed: bool) -> None:
    if beyond and not pushed:
        raise TrainingError("--beyond goes away from what --teacher pushed=POLICY does; give that too.")
    for role, share in beyond.items():
        if role == "pushed":
            raise TrainingError("--beyond names 'pushed', from which the others go away; name another role.")
        if not 0.0 <= share <= MOST_BEYOND:
            raise TrainingError(f"--beyond of '{role}' is {share:g}; it must be from 0 to {MOST_BEYOND:g}.")


def _teacher(path: Path, robot: RobotFacts) -> dict[str, np.ndarray]:
    """The arrays of a policy file, each of the shape that it must have."""
    arrays = network_of(path, robot)
    count = max(1, _layers(arrays))
    layers = [f"L{number}_{part}" for number in range(count) for part in "wb"]
    missing = [name for name in ("mean", "std", *layers) if name not in arrays]
    if missing:
        raise TrainingError(f"{path}: lacks {', '.join(missing)}; it is no policy of ours.")
    seen, told = HISTORY * (9 + 3 * len(robot.policy_joints)), len(robot.controlled)
    inner = [len(np.atleast_1d(arrays[f"L{number}_w"])) for number in range(count - 1)]
    sizes = [seen, *inner, told]
    wanted: dict[str, tuple[int, ...]] = {"mean": (seen,), "std": (seen,)}
    for number, (into, out) in enumerate(pairwise(sizes)):
        wanted |= {f"L{number}_w": (out, into), f"L{number}_b": (out,)}
    for name, shape in wanted.items():
        if arrays[name].shape != shape:
            raise TrainingError(
                f"{path}: '{name}' is {arrays[name].shape}; it must be {shape}, of an actor that sees {seen} numbers "
                f"and moves {told} joints. Take another policy."
            )
    if not (arrays["std"] + arrays["eps"] > 0.0).all():
        raise TrainingError(f"{path}: 'std' and 'eps' must be over 0 together: what is seen is divided by them.")
    return arrays


def _layers(arrays: Mapping[str, np.ndarray]) -> int:
    return sum(name.startswith("L") and name.endswith("_w") for name in arrays)


class _Network:
    """A policy file's network on a device."""

    def __init__(self, arrays: Mapping[str, np.ndarray], device: str):
        def tensor(name: str) -> torch.Tensor:
            return torch.from_numpy(np.asarray(arrays[name], dtype=np.float32)).to(device)

        self._mean, self._scale = tensor("mean"), tensor("std") + arrays["eps"].item()
        self._layers = [
            (tensor(f"L{number}_w").T.contiguous(), tensor(f"L{number}_b")) for number in range(_layers(arrays))
        ]

    def __call__(self, observation: torch.Tensor) -> torch.Tensor:
        value = (observation - self._mean) / self._scale
        for number, (weight, bias) in enumerate(self._layers):
            value = value @ weight + bias
            value = torch.nn.functional.elu(value) if number < len(self._layers) - 1 else value
        return value
