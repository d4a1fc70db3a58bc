"""Velocity commands: their distribution, and the command term."""

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
"""Rate of change of a slewed command [m/s^2, rad/s^2], as the deployment limits it."""
OLD_S = 10.0
"""Age of the command of an episode that begins at the commanded velocity [s]."""
STANDING = 1e-6
"""A command that exceeds this on no axis is the command to stand [m/s, rad/s]."""


def moves(command: torch.Tensor) -> torch.Tensor:
    """Whether commands (n, 3) ask for more than standing (n,)."""
    return (command.abs() > STANDING).any(dim=1)


def draw_commands(count: int, config: CommandsConfig, device: str | torch.device) -> torch.Tensor:
    """Commands (count, 3): forward and lateral velocity [m/s], yaw rate [rad/s].

    Every kind is drawn for all environments and chosen by a mask, so that no count has to be known.
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


def _fast(count: int, largest_yaw: float, device: str | torch.device) -> torch.Tensor:
    """Fast forward commands, half of which turn."""
    forward = _uniform(count, *FAST, device)
    yaw = _uniform(count, -largest_yaw, largest_yaw, device) * (torch.rand(count, device=device) < 0.5)
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
    """The command of each environment, drawn again every few seconds; in distillation the clip's."""

    cfg: VelocityCommandCfg

    def __init__(self, cfg: VelocityCommandCfg, env):
        super().__init__(cfg, env)
        self._command = torch.zeros(self.num_envs, 3, device=self.device)
        self.goal = torch.zeros(self.num_envs, 3, device=self.device)
        """What the command (n, 3) is, or approaches where it is slewed."""
        slewed = torch.rand(self.num_envs, device=self.device) < cfg.config.slew_share
        self._rate = torch.where(slewed, SLEW, torch.inf)[:, None]
        self.age = torch.zeros(self.num_envs, device=self.device)
        """Time since the command was drawn [s]."""
        env.restarts.append(self.restart)

    @property
    def command(self) -> torch.Tensor:
        return self._command

    def compute(self, dt: float | torch.Tensor, env_ids: torch.Tensor | None = None) -> None:
        """Let commands grow older by `dt` [s], a number or (n,); where the time is up, draw the next one."""
        self.time_left -= dt
        self._draw(self.time_left <= 0.0)
        self.age += dt
        self._command.copy_(self._approached(dt))
        if self._env.teacher is not None:
            self.goal.copy_(self._env.teacher.command)
            self._command.copy_(self._env.teacher.command)

    def _approached(self, dt: float | torch.Tensor) -> torch.Tensor:
        """The command (n, 3) after another `dt` [s] on its way to the goal."""
        most = self._rate * torch.as_tensor(dt, device=self.device).reshape(-1, 1).clamp(min=1e-9)
        way = self.goal - self._command
        return torch.where(way.abs() <= most, self.goal, self._command + torch.sign(way) * most.nan_to_num(posinf=0.0))

    def restart(self, mask: torch.Tensor) -> None:
        """Draw the command of environments (n,) that begin an episode, or take the start frame's, OLD_S old. A slewed
        command begins at the velocity of the start state."""
        self._draw(mask)
        own = self._env.own_command
        kept = mask & ~own.isnan().any(dim=1)
        replace(self._command, mask, torch.where(self._rate.isinf(), self.goal, self._env.start_velocity))
        for value in (self.goal, self._command):
            replace(value, kept, own)
        replace(self.age, kept, OLD_S)

    def _draw(self, mask: torch.Tensor) -> None:
        low, high = self.cfg.resampling_time_range
        replace(self.time_left, mask, low + (high - low) * torch.rand_like(self.time_left))
        replace(self.goal, mask, draw_commands(self.num_envs, self.cfg.config, self.device))
        replace(self.age, mask, 0.0)

    def _resample_command(self, env_ids: torch.Tensor) -> None:
        """Nothing: `compute` and `restart` draw."""

    def _update_command(self, env_ids: torch.Tensor | None) -> None:
        """Nothing: `compute` does it."""

    def _update_metrics(self) -> None:
        """None: `curves.py` keeps the figures."""
