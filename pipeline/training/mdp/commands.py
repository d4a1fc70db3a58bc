"""Distribution of velocity commands, and the command term."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from mjlab.managers.command_manager import CommandTerm, CommandTermCfg

from pipeline.training.config import CommandsConfig
from pipeline.training.masks import replace

NORMAL = ((-0.6, 1.0), (-0.6, 0.6), (-1.5, 1.5))
"""Forward [m/s], lateral [m/s], yaw rate [rad/s] (paper)."""
FAST = (1.0, 2.0)
"""Forward [m/s] (paper)."""
RESAMPLE_S = (8.0, 12.0)
"""Time between commands [s]."""
SLEW = 1.0
"""Rate limit of a slewed command [m/s^2, rad/s^2], as in deployment."""
OLD_S = 10.0
"""Initial command age of an episode that begins at the commanded velocity [s]."""
STANDING = 1e-6
"""A command below this on all axes is a standing command [m/s, rad/s]."""


def moves(command: torch.Tensor) -> torch.Tensor:
    """Whether commands (n, 3) are moving, not standing, commands (n,)."""
    return (command.abs() > STANDING).any(dim=1)


def draw_commands(count: int, config: CommandsConfig, device: str | torch.device) -> torch.Tensor:
    """Draw commands (count, 3): forward and lateral velocity [m/s], yaw rate [rad/s].

    Every kind is drawn for all environments and selected by a mask, which avoids a GPU synchronization.
    """
    normal = torch.stack([_uniform(count, *span, device) for span in NORMAL], dim=1)
    axis = torch.randint(3, (count,), device=device)
    single = normal * (axis[:, None] == torch.arange(3, device=device))
    kinds = (
        (config.standing_share, torch.zeros_like(normal)),
        (config.fast_share, _fast(count, config.fast_yaw, device)),
        (config.single_axis_share, single),
    )
    command, kind, bound = normal, torch.rand(count, device=device)[:, None], 0.0
    for share, drawn in kinds:
        command = torch.where((kind >= bound) & (kind < bound + share), drawn, command)
        bound += share
    return command


def _fast(count: int, max_yaw_rate: float, device: str | torch.device) -> torch.Tensor:
    """Draw fast forward commands; half of them have a yaw rate."""
    forward = _uniform(count, *FAST, device)
    yaw = _uniform(count, -max_yaw_rate, max_yaw_rate, device) * (torch.rand(count, device=device) < 0.5)
    return torch.stack([forward, torch.zeros_like(yaw), yaw], dim=1)


def _uniform(count: int, low: float, high: float, device: str | torch.device) -> torch.Tensor:
    return low + (high - low) * torch.rand(count, device=device)


@dataclass(kw_only=True)
class VelocityCommandCfg(CommandTermCfg):
    """Configuration of `VelocityCommand`."""

    config: CommandsConfig

    def build(self, env) -> VelocityCommand:
        return VelocityCommand(self, env)


class VelocityCommand(CommandTerm):
    """Velocity command of each environment, resampled every few seconds; in distillation the clip's."""

    cfg: VelocityCommandCfg

    def __init__(self, cfg: VelocityCommandCfg, env):
        super().__init__(cfg, env)
        self._command = torch.zeros(self.num_envs, 3, device=self.device)
        self.goal = torch.zeros(self.num_envs, 3, device=self.device)
        """Target (n, 3) of the command, which a slewed command approaches."""
        slewed = torch.rand(self.num_envs, device=self.device) < cfg.config.slew_share
        self._rate = torch.where(slewed, SLEW, torch.inf)[:, None]
        self.age = torch.zeros(self.num_envs, device=self.device)
        """Time since the command was drawn [s]."""
        env.restarts.append(self.restart)

    @property
    def command(self) -> torch.Tensor:
        return self._command

    def compute(self, dt: float | torch.Tensor, env_ids: torch.Tensor | None = None) -> None:
        """Advance by `dt` [s], a number or (n,), and resample expired commands."""
        self.time_left -= dt
        self._draw(self.time_left <= 0.0)
        self.age += dt
        self._command.copy_(self._slewed(dt))
        if self._env.teacher is not None:
            self.goal.copy_(self._env.teacher.command)
            self._command.copy_(self._env.teacher.command)

    def _slewed(self, dt: float | torch.Tensor) -> torch.Tensor:
        """The command (n, 3) after approaching the goal for `dt` [s]."""
        step = self._rate * torch.as_tensor(dt, device=self.device).reshape(-1, 1).clamp(min=1e-9)
        gap = self.goal - self._command
        return torch.where(gap.abs() <= step, self.goal, self._command + torch.sign(gap) * step.nan_to_num(posinf=0.0))

    def restart(self, mask: torch.Tensor) -> None:
        """Resample the commands of environments in `mask` (n,), or keep the start frame's, with age OLD_S. A slewed
        command starts at the velocity of the start state."""
        self._draw(mask)
        start = self._env.start_command
        kept = mask & ~start.isnan().any(dim=1)
        replace(self._command, mask, torch.where(self._rate.isinf(), self.goal, self._env.start_velocity))
        for value in (self.goal, self._command):
            replace(value, kept, start)
        replace(self.age, kept, OLD_S)

    def _draw(self, mask: torch.Tensor) -> None:
        low, high = self.cfg.resampling_time_range
        replace(self.time_left, mask, low + (high - low) * torch.rand_like(self.time_left))
        replace(self.goal, mask, draw_commands(self.num_envs, self.cfg.config, self.device))
        replace(self.age, mask, 0.0)

    def _resample_command(self, env_ids: torch.Tensor) -> None:
        """No-op: `compute` and `restart` resample."""

    def _update_command(self, env_ids: torch.Tensor | None) -> None:
        """No-op: `compute` updates the command."""

    def _update_metrics(self) -> None:
        """No-op: `curves.py` records the metrics."""
