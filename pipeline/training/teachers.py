"""Several policies that teach one network, each where it is the better one: which of them a robot listens to.

Roles, the first that holds: `pushed` for a second after a push began, or after who leans too far where a run says so;
`standing` when told to stand; `sloped` when told to walk mainly forward on ground that slopes, where that has a
teacher; `ahead` when told so elsewhere, from .55 m/s on (and when under way, where a run says so), and of these `fast`
from .85 m/s on and `run` from where a run says so; `other` for the rest. A role without a teacher of its own is
`other`'s, but `run` that of `fast`, and `fast` that of `ahead`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch

from pipeline.training.bundle import RobotFacts
from pipeline.training.given_network import network_of
from pipeline.training.mirror import Mirror
from pipeline.training.observations import HISTORY
from pipeline.training.pushes import since_push
from pipeline.training.training_error import TrainingError
from pipeline.training.walked_speeds import WalkedSpeeds, corrected

ROLES = ("other", "ahead", "fast", "run", "sloped", "standing", "pushed")
"""Each goes before those named earlier."""
STANDS_IN = {"run": "fast", "fast": "ahead"}
"""Who teaches a role that has no teacher of its own; else, and where that has none either, it is `other`."""
ASIDE_M_S = 0.3
"""Ahead is this fast aside at most."""


@dataclass(frozen=True, kw_only=True)
class Borders:
    """Where a role begins and ends, as far as a run may choose."""

    pushed_s: float = 1.0
    """How long after its beginning a push is answered [s]."""
    unsteady_deg: float = math.inf
    """Who leans more than this, on ground that does not slope, counts as pushed just then [deg]."""
    turn_rad_s: float = 1.0
    """Ahead is turning this fast at most."""
    ahead_m_s: float = 0.55
    """Ahead is this fast at least."""
    under_way: float = 0.0
    """Ahead goes, over a step, at this share of what it is told at least: who sets off does not yet."""
    fast_m_s: float = 0.85
    """Ahead from this speed on is fast …"""
    run_m_s: float = math.inf
    """… and from this one on run."""

    def __post_init__(self) -> None:
        for name, value in (
            ("--pushed-s", self.pushed_s),
            ("--ahead-turn", self.turn_rad_s),
            ("--ahead", self.ahead_m_s),
            ("--under-way", self.under_way),
            ("--fast", self.fast_m_s),
            ("--run", self.run_m_s),
            ("--unsteady-deg", self.unsteady_deg),
        ):
            if not value >= 0.0:
                raise TrainingError(f"{name} is {value:g}; it must be 0 or more.")


def role_of(
    command: torch.Tensor,
    since_s: torch.Tensor,
    borders: Borders,
    velocity: torch.Tensor,
    sloped: torch.Tensor | None = None,
) -> torch.Tensor:
    """The place in ROLES (n,) of commands (n, 3) [m/s, m/s, rad/s], seconds since the latest push began (n,) and
    velocities averaged over a step (n, 3) like commands; `sloped`: who (n,) walks on ground that slopes, where that is
    a role of its own."""
    forward, lateral, yaw = command.unbind(dim=1)
    ahead = (forward >= borders.ahead_m_s) & (lateral.abs() <= ASIDE_M_S) & (yaw.abs() <= borders.turn_rad_s)
    ahead &= velocity[:, 0] >= borders.under_way * forward
    role = ahead.long()
    for border in (borders.fast_m_s, max(borders.fast_m_s, borders.run_m_s)):
        role += (ahead & (forward >= border)).long()
    if sloped is not None:
        role = torch.where(ahead & sloped, ROLES.index("sloped"), role)
    role = torch.where((command == 0.0).all(dim=1), ROLES.index("standing"), role)
    return torch.where(since_s < borders.pushed_s, ROLES.index("pushed"), role)


def is_of(role: torch.Tensor, names: Sequence[str]) -> torch.Tensor:
    """Which of the roles (n,) are among some."""
    return torch.stack([role == ROLES.index(name) for name in names]).any(dim=0)


class Unsteadiness:
    """How long ago each of N environments was last pushed in this episode, or leant beyond a bound."""

    def __init__(self, env, bound_deg: float):
        self._env = env
        self._least = math.sin(math.radians(bound_deg)) if bound_deg < 90.0 else math.inf
        self._leant_s = torch.full((env.num_envs,), math.inf, device=env.device)

    def since(self) -> torch.Tensor:
        """That [s] (n,); once a control step, before it. Where the ground slopes nobody counts as leaning."""
        env = self._env
        leans = torch.linalg.norm(env.readings.gravity_b[:, :2], dim=1) > self._least
        if env.slopes is not None:
            leans &= env.slopes.level
        waited = torch.where(env.episode_length_buf == 0, math.inf, self._leant_s + env.step_dt)
        self._leant_s = torch.where(leans, 0.0, waited)
        return torch.minimum(since_push(env), self._leant_s)


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
    ):
        """`walks`: how fast the teacher of a role walks as it is told (`walked_speeds.py`). `both_sides`: roles whose
        teacher answers as it and its mirror image do, on average, and so walks straight. `with_error`: roles whose
        teacher is told what the velocity lacks on top of the command.

        Raises TrainingError for a role that is none, or has no teacher but a speed, without `other`, and for a file
        that is no policy for this robot, its gains and what its actor sees and does."""
        unknown = [role for role in paths if role not in ROLES]
        if unknown:
            raise TrainingError(f"--teacher names '{unknown[0]}'; roles are {', '.join(ROLES)}.")
        if "other" not in paths:
            raise TrainingError("--teacher other=POLICY is needed: who teaches where nobody else does.")
        for named, roles in (
            ("--walks", tuple(walks or {})),
            ("--both-sides", both_sides),
            ("--with-error", with_error),
        ):
            strangers = [role for role in roles if role not in paths]
            if strangers:
                raise TrainingError(f"{named} names '{strangers[0]}', which has no --teacher of its own.")
        self._speeds = {role: WalkedSpeeds(text) for role, text in (walks or {}).items()}
        self._networks = {role: _Network(_teacher(path, robot), device) for role, path in paths.items()}
        self._mirrors = dict.fromkeys(both_sides, Mirror(robot, device) if both_sides else None)
        self._with_error = frozenset(with_error)
        self._taken = torch.tensor([ROLES.index(_taught(role, paths)) for role in ROLES], device=device)

    def sloped(self, env) -> torch.Tensor | None:
        """Who (n,) walks on ground that slopes, where that has a teacher and ground slopes."""
        return None if "sloped" not in self._networks or env.slopes is None else ~env.slopes.level

    def act(self, observation: torch.Tensor, role: torch.Tensor, error: torch.Tensor | None = None) -> torch.Tensor:
        """What (n, a) the teachers of roles (n,) do at what the actor sees (n, o); `error`: by how much the command is
        over the averaged velocity (n, 3), for those who are corrected by it."""
        taken = self._taken[role]
        told = {name: self._answer(name, observation, error) for name in self._networks}
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
