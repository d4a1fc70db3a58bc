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
        self._trunk, _ = self._robot.find_bodies(env.context.bundle.robot.root_link)
        self._wait = self._drawn(env.num_envs)
        self._left = torch.zeros(env.num_envs, device=env.device)

    def _drawn(self, count: int) -> torch.Tensor:
        low, high = self._env.context.options.push_interval_s
        return low + (high - low) * torch.rand(count, device=self._env.device)

    def __call__(self, env, env_ids: torch.Tensor | None) -> None:
        options = env.context.options
        self._wait -= env.step_dt
        pushed = self._left > 0.0
        self._left -= env.step_dt
        ended = (pushed & (self._left <= 1e-6)).nonzero().flatten()
        self._write(ended, torch.zeros(len(ended), 3, device=env.device))
        begun = (self._wait <= 0.0).nonzero().flatten()
        largest = grown(options.push_impulse, env.iteration(), options.push_iterations) / FORCE_S
        self._write(begun, horizontal(len(begun), largest, env.device) * env.pushed[begun, None])
        self._left[begun] = FORCE_S
        self._wait[begun] = self._drawn(len(begun))

    def _write(self, env_ids: torch.Tensor, force_w: torch.Tensor) -> None:
        if len(env_ids):
            self._robot.write_external_wrench_to_sim(
                force_w[:, None], torch.zeros_like(force_w)[:, None], env_ids=env_ids, body_ids=self._trunk
            )

    def reset(self, env_ids: torch.Tensor | None = None) -> None:
        """No force at the start of an episode (mjlab has cleared it), and a new wait."""
        ids = slice(None) if env_ids is None else env_ids
        self._left[ids] = 0.0
        self._wait[ids] = self._drawn(len(self._wait[ids]))
