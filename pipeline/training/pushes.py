"""Pushes: sudden changes of the base's velocity, and forces on the trunk for a tenth of a second."""

from __future__ import annotations

import math

import torch

FORCE_S = 0.1
"""How long a force acts [s]."""
LEAST_SHARE = 0.2
"""A push is at least this share of the largest one."""


def horizontal(count: int, largest: float, device: str | torch.device) -> torch.Tensor:
    """Vectors (count, 3) in random horizontal directions, their lengths evenly up to the largest one."""
    angle = 2.0 * math.pi * torch.rand(count, device=device)
    length = largest * (LEAST_SHARE + (1.0 - LEAST_SHARE) * torch.rand(count, device=device))
    return torch.stack([length * torch.cos(angle), length * torch.sin(angle), torch.zeros_like(angle)], dim=1)


def grown(span: tuple[float, float], iteration: float, iterations: int) -> float:
    """A value on its way from the first to the last of a span."""
    share = 1.0 if iterations <= 0 else min(1.0, iteration / iterations)
    return span[0] + (span[1] - span[0]) * share


def push_velocity(env, env_ids: torch.Tensor) -> None:
    """Change the base's velocity at once."""
    options = env.context.options
    largest = grown(options.push_speed, env.iteration(), options.push_iterations)
    robot = env.scene["robot"]
    velocity = torch.cat([env.readings.lin_vel_w[env_ids], robot.data.root_link_ang_vel_w[env_ids]], dim=1)
    velocity[:, :3] += horizontal(len(env_ids), largest, env.device) * env.pushed[env_ids, None]
    robot.write_root_link_velocity_to_sim(velocity, env_ids=env_ids)


class PushForce:
    """Every few seconds a force on the trunk's centre of mass, for FORCE_S."""

    def __init__(self, cfg, env):
        self._env = env
        self._robot = env.scene["robot"]
        (trunk,), _ = self._robot.find_bodies(env.context.bundle.robot.root_link)
        self._trunk = slice(trunk, trunk + 1)  # a list of indices would be copied to the GPU at each step
        self._wait = self._drawn(env.num_envs)
        self._left = torch.zeros(env.num_envs, device=env.device)
        self._force_w = torch.zeros(env.num_envs, 3, device=env.device)

    def _drawn(self, count: int) -> torch.Tensor:
        low, high = self._env.context.options.push_interval_s
        return low + (high - low) * torch.rand(count, device=self._env.device)

    def __call__(self, env, env_ids: torch.Tensor | None) -> None:
        """All forces are written, also those that are none: to count them, a processor would have to wait."""
        options, count = env.context.options, env.num_envs
        self._wait -= env.step_dt
        self._left -= env.step_dt
        begins = self._wait <= 0.0
        largest = grown(options.push_impulse, env.iteration(), options.push_iterations) / FORCE_S
        drawn = horizontal(count, largest, env.device) * env.pushed[:, None]
        goes_on = torch.where((self._left > 1e-6)[:, None], self._force_w, 0.0)
        self._force_w = torch.where(begins[:, None], drawn, goes_on)
        self._left = torch.where(begins, FORCE_S, self._left)
        self._wait = torch.where(begins, self._drawn(count), self._wait)
        force = self._force_w[:, None]
        self._robot.write_external_wrench_to_sim(force, torch.zeros_like(force), body_ids=self._trunk)

    def reset(self, env_ids: torch.Tensor | None = None) -> None:
        """No force at the start of an episode (mjlab has cleared it), and a new wait."""
        ids = slice(None) if env_ids is None else env_ids
        self._left[ids], self._force_w[ids] = 0.0, 0.0
        self._wait[ids] = self._drawn(len(self._wait[ids]))
