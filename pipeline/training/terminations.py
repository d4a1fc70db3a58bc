"""When an episode ends before its time."""

from __future__ import annotations

import math

import torch
from mjlab.envs.mdp.terminations import time_out
from mjlab.managers.termination_manager import TerminationTermCfg

from pipeline.training.masks import replace
from pipeline.training.options import Options


def fallen(gravity_b: torch.Tensor, height: torch.Tensor, max_tilt_deg: float, min_height_m: float) -> torch.Tensor:
    """Whether the root is tilted too far or too low, or its state is not a number (n,)."""
    upright = -gravity_b[:, 2] >= math.cos(math.radians(max_tilt_deg))
    return ~(upright & (height >= min_height_m))


def stands_though_told(command: torch.Tensor, velocity: torch.Tensor, options: Options) -> torch.Tensor:
    """Whether (n,) the robot follows nothing of a command to move, to turn, or both.

    Moving: commanded speed above `stall_speed`, and velocity along the command below `stall_share` of it. Turning:
    likewise with the yaw rate. Who follows one half of a command to do both stalls only with `stall_either`.
    """
    speed = torch.linalg.norm(command[:, :2], dim=1)
    along = (velocity[:, :2] * command[:, :2]).sum(dim=1) / speed.clamp(min=1e-6)
    told_to_move, moves = speed > options.stall_speed, along >= options.stall_share * speed
    turn = command[:, 2].abs()
    turned = velocity[:, 2] * torch.sign(command[:, 2])
    told_to_turn, turns = turn > options.stall_yaw, turned >= options.stall_share * turn
    if options.stall_either:
        return (told_to_move & ~moves) | (told_to_turn & ~turns)
    return (told_to_move | told_to_turn) & ~(told_to_move & moves) & ~(told_to_turn & turns)


class Stall:
    """Ends an episode in which `stands_though_told` holds for `stall_s`, of the averaged velocity."""

    def __init__(self, cfg: TerminationTermCfg, env):
        self._seconds = torch.zeros(env.num_envs, device=env.device)
        env.restarts.append(self.restart)

    def __call__(self, env) -> torch.Tensor:
        options = env.context.options
        stalls = stands_though_told(env.command, env.readings.mean_velocity, options)
        stalls &= env.velocity_command.age > options.stall_s
        self._seconds.copy_(torch.where(stalls, self._seconds + env.step_dt, 0.0))
        env.stalled = self._seconds > options.stall_s
        return env.stalled

    def restart(self, mask: torch.Tensor) -> None:
        """No stall at the start of an episode."""
        replace(self._seconds, mask, 0.0)


def _fell(env) -> torch.Tensor:
    env.readings.advance()
    if env.leg_swings is not None:
        env.leg_swings.advance()
    if env.power_excess is not None:
        env.power_excess.advance()
    if env.tracked_clip is not None:
        env.tracked_clip.advance()
    options = env.context.options
    env.fell = fallen(env.readings.gravity_b, env.readings.height, options.max_tilt_deg, options.min_height_m)
    return env.fell


def termination_cfg(options: Options) -> dict[str, TerminationTermCfg]:
    """Falls, the stall rule where it is on, the end of the time; where clips are tracked, straying and their end."""
    rules = {"fell": TerminationTermCfg(func=_fell), "time": TerminationTermCfg(func=time_out, time_out=True)}
    if options.stall:
        rules["stall"] = TerminationTermCfg(func=Stall)
    if options.tracked:
        rules["over"] = TerminationTermCfg(func=lambda env: env.tracked_clip.over, time_out=True)
        rules["strayed"] = TerminationTermCfg(func=lambda env: env.tracked_clip.strayed)
    return rules
