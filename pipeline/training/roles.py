"""Whose a robot's state is, of those who teach one network: its role, by what it is told and what has befallen it.

Roles, the first that holds: `pushed` for a second after a push began, or after who leans too far where a run says so;
`standing` when told to stand; `sloped` when told to walk mainly forward on ground that slopes, where that has a
teacher; `ahead` when told so elsewhere, from .55 m/s on, and of these `fast` from .85 m/s on and `run` from where a run
says so; `other` for the rest, who sets off, where a run says so, among them. A role without a teacher of its own is
`other`'s, but `run` that of `fast`, and `fast` that of `ahead`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch

from pipeline.learning.training_error import TrainingError
from pipeline.training.pushes import since_push

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
    """Ahead, on slopes too, is who goes at this share of what it is told at least, by the averaged velocity; 0: all."""
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
        if self.under_way > 1.0:
            raise TrainingError(f"--under-way is {self.under_way:g}; it is a share and must be 1 at most.")


def role_of(
    command: torch.Tensor,
    since_s: torch.Tensor,
    borders: Borders,
    velocity: torch.Tensor,
    sloped: torch.Tensor | None = None,
) -> torch.Tensor:
    """The place in ROLES (n,) of commands (n, 3) [m/s, m/s, rad/s], seconds since the latest push began (n,) and
    averaged velocities (n, 3) like commands; `sloped`: who (n,) walks on ground that slopes, where that is
    a role of its own."""
    forward, lateral, yaw = command.unbind(dim=1)
    ahead = (forward >= borders.ahead_m_s) & (lateral.abs() <= ASIDE_M_S) & (yaw.abs() <= borders.turn_rad_s)
    if borders.under_way > 0.0:
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
