"""Velocity commands: how they are drawn, and the term that hands them to the environment."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from mjlab.managers.command_manager import CommandTerm, CommandTermCfg

from pipeline.training.masks import replace
from pipeline.training.options import Options

NORMAL = ((-0.6, 1.0), (-0.6, 0.6), (-1.5, 1.5))
"""Forward [m/s], lateral [m/s], yaw rate [rad/s]."""
FAST = (1.0, 2.0)
"""Forward [m/s]."""
FAST_YAW = 0.5
"""Largest yaw rate of half of the fast commands [rad/s]; the others go straight. For `paper`, no turning."""
SLOW = (0.2, 0.4)
"""Speed of slow commands [m/s]."""
ASIDE, TURN = 0.2, 0.3
"""Most to the side [m/s] and of turning [rad/s] in half of the commands ahead."""
SLEW = 1.0
"""How fast a command changes where it is slewed [m/s^2, rad/s^2]."""
OLD_S = 10.0
"""Age of the command of an episode that begins at the velocity it commands [s]: it may stall at once."""


def draw_commands(count: int, options: Options, device: str | torch.device) -> torch.Tensor:
    """Commands (count, 3): forward and lateral velocity [m/s], yaw rate [rad/s].

    Each kind is drawn for all and taken by some: to count who is of a kind, a processor would have to wait for its GPU.
    """
    normal = torch.stack([_uniform(count, *span, device) for span in NORMAL], dim=1)
    kinds = [(options.standing_share, torch.zeros_like(normal)), (options.fast_share, _fast(count, options, device))]
    if options.mixture == "balanced":
        kinds += [
            (share, normal * _unit(axis, device)) for axis, share in zip(range(3), options.alone_shares, strict=True)
        ]
        kinds.append((options.slow_share, _slow(count, device)))
        if options.ahead_share:
            kinds.append((options.ahead_share, _ahead(count, options, device)))
    command, kind, bound = normal, torch.rand(count, device=device)[:, None], 0.0
    for share, drawn in kinds:
        command = torch.where((kind >= bound) & (kind < bound + share), drawn, command)
        bound += share
    return command


def _unit(axis: int, device: str | torch.device) -> torch.Tensor:
    return (torch.arange(3, device=device) == axis).float()


def _slow(count: int, device: str | torch.device) -> torch.Tensor:
    """Forward, back, left and right, nothing else."""
    direction = torch.randint(4, (count,), device=device)
    signed = _uniform(count, *SLOW, device) * torch.where(direction % 2 == 0, 1.0, -1.0)
    ahead = direction < 2
    return torch.stack([signed * ahead, signed * ~ahead, torch.zeros_like(signed)], dim=1)


def _ahead(count: int, options: Options, device: str | torch.device) -> torch.Tensor:
    """Forward, half of them with a little to the side and of turning."""
    forward = _uniform(count, *options.ahead_speeds, device)
    beside = torch.stack([_uniform(count, -most, most, device) for most in (ASIDE, TURN)], dim=1)
    bent = torch.rand(count, 1, device=device) < 0.5
    return torch.cat([forward[:, None], beside * bent], dim=1)


def _fast(count: int, options: Options, device: str | torch.device) -> torch.Tensor:
    forward = _uniform(count, *FAST, device)
    yaw = torch.zeros(count, device=device)
    if options.mixture == "balanced":
        yaw = _uniform(count, -FAST_YAW, FAST_YAW, device) * (torch.rand(count, device=device) < 0.5)
    return torch.stack([forward, torch.zeros_like(yaw), yaw], dim=1)


def _uniform(count: int, low: float, high: float, device: str | torch.device) -> torch.Tensor:
    return low + (high - low) * torch.rand(count, device=device)


@dataclass(kw_only=True)
class VelocityCommandCfg(CommandTermCfg):
    """Configuration of `VelocityCommand`."""

    def build(self, env) -> VelocityCommand:
        return VelocityCommand(self, env)


class VelocityCommand(CommandTerm):
    """The command of each environment, drawn anew every few seconds."""

    def __init__(self, cfg: VelocityCommandCfg, env):
        super().__init__(cfg, env)
        self._command = torch.zeros(self.num_envs, 3, device=self.device)
        self.goal = torch.zeros(self.num_envs, 3, device=self.device)
        """What the command (n, 3) is, or comes to where it is slewed."""
        slewed = torch.rand(self.num_envs, device=self.device) < env.context.options.slew_share
        self._fastest = torch.where(slewed, SLEW, torch.inf)[:, None]
        self.coming = draw_commands(self.num_envs, env.context.options, self.device)
        """The commands (n, 3) that come next."""
        self.age = torch.zeros(self.num_envs, device=self.device)
        """Time since the command was given [s]."""
        env.restarts.append(self.restart)

    @property
    def command(self) -> torch.Tensor:
        return self._command

    def give(self, env_ids: torch.Tensor, command: torch.Tensor, age: float = 0.0) -> None:
        """Set the command of some environments, as if it were `age` [s] old."""
        self._command[env_ids] = command
        self.goal[env_ids] = command
        self.age[env_ids] = age

    def compute(self, dt: float | torch.Tensor, env_ids: torch.Tensor | None = None) -> None:
        """The commands grow older by `dt` [s], a number or (n,); those whose time is up get the next one. Who tracks a
        clip is told the clip's."""
        self.time_left -= dt
        clip, over = self._env.tracked_clip, self.time_left <= 0.0
        self._draw(over if clip is None else over & ~clip.tracks)
        self.age += dt
        self._command.copy_(self._slewed(dt))
        if clip is not None:
            for told in (self.goal, self._command):
                replace(told, clip.tracks, clip.command)

    def _slewed(self, dt: float | torch.Tensor) -> torch.Tensor:
        """The command (n, 3) after another `dt` [s] on its way to the goal, or there at once."""
        most = self._fastest * torch.as_tensor(dt, device=self.device).reshape(-1, 1).clamp(min=1e-9)
        way = self.goal - self._command
        return torch.where(way.abs() <= most, self.goal, self._command + torch.sign(way) * most.nan_to_num(posinf=0.0))

    def restart(self, mask: torch.Tensor) -> None:
        """Another command for environments that begin an episode, or the one that goes with what they begin at, as if
        it were OLD_S old. A command that is slewed begins at what the robot does then."""
        self._draw(mask)
        own = self._env.own_command
        kept = mask & ~own.isnan().any(dim=1)
        replace(self._command, mask, torch.where(self._fastest.isinf(), self.goal, self._env.begun_command))
        for told in (self.goal, self._command):
            replace(told, kept, own)
        replace(self.age, kept, OLD_S)

    def _draw(self, mask: torch.Tensor) -> None:
        low, high = self.cfg.resampling_time_range
        replace(self.time_left, mask, low + (high - low) * torch.rand_like(self.time_left))
        replace(self.goal, mask, self.coming)
        replace(self.coming, mask, draw_commands(self.num_envs, self._env.context.options, self.device))
        replace(self.age, mask, 0.0)

    def _resample_command(self, env_ids: torch.Tensor) -> None:
        """Nothing: `compute` and `restart` draw."""

    def _update_command(self, env_ids: torch.Tensor | None) -> None:
        """Nothing: `compute` does it."""

    def _update_metrics(self) -> None:
        """None: `curves.py` keeps the figures."""
