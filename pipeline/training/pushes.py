"""Pushes: sudden changes of the base's velocity, and forces on the trunk for a tenth of a second."""

from __future__ import annotations

import math

import torch

from pipeline.training.masks import replace

FORCE_S = 0.1
"""How long a force acts [s]."""
LEAST_SHARE = 0.2
"""A push is at least this share of the largest one."""


def horizontal(count: int, largest: float | torch.Tensor, device: str | torch.device) -> torch.Tensor:
    """Vectors (count, 3) in random horizontal directions, their lengths evenly up to the largest one."""
    angle = 2.0 * math.pi * torch.rand(count, device=device)
    length = largest * (LEAST_SHARE + (1.0 - LEAST_SHARE) * torch.rand(count, device=device))
    return torch.stack([length * torch.cos(angle), length * torch.sin(angle), torch.zeros_like(angle)], dim=1)


class Waits:
    """How long each environment is still left alone; drawn anew when a wait is over and when an episode begins."""

    def __init__(self, env):
        self._span, self._step_s = env.context.options.push_interval_s, env.step_dt
        self._left = torch.zeros(env.num_envs, device=env.device)
        self.restart(torch.ones_like(self._left, dtype=torch.bool))

    def over(self) -> torch.Tensor:
        """Whose wait ends with this step (n,)."""
        self._left -= self._step_s
        ends = self._left <= 0.0
        self.restart(ends)
        return ends

    def restart(self, mask: torch.Tensor) -> None:
        """Draw the waits of some anew."""
        low, high = self._span
        replace(self._left, mask, low + (high - low) * torch.rand_like(self._left))


class PushVelocity:
    """Every few seconds the base's velocity is another at once."""

    def __init__(self, cfg, env):
        self._waits = Waits(env)
        env.restarts.append(self._waits.restart)

    def __call__(self, env, env_ids: torch.Tensor | None) -> None:
        pushed = (self._waits.over() & env.pushed)[:, None]
        velocity_w = env.sim.data.qvel[:, :3]
        velocity_w += torch.where(pushed, horizontal(env.num_envs, env.ramps.push_speed, env.device), 0.0)


class PushForce:
    """Every few seconds a force on the trunk's centre of mass, for FORCE_S; `trunk_forces.py` brings it there."""

    def __init__(self, cfg, env):
        self._force_w = env.trunk_forces.push_w
        self._waits = Waits(env)
        self._left = torch.zeros(env.num_envs, device=env.device)
        env.restarts.append(self.restart)

    def __call__(self, env, env_ids: torch.Tensor | None) -> None:
        self._left -= env.step_dt
        begins = self._waits.over()
        drawn = horizontal(env.num_envs, env.ramps.push_impulse / FORCE_S, env.device) * env.pushed[:, None]
        replace(self._force_w, self._left <= 1e-6, 0.0)
        replace(self._force_w, begins, drawn)
        replace(self._left, begins, FORCE_S)

    def restart(self, mask: torch.Tensor) -> None:
        """No push goes on from one episode to the next, and a new wait."""
        replace(self._left, mask, 0.0)
        self._waits.restart(mask)
