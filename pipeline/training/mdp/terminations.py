"""Terminations: mjlab's terms for falls, and a term for ignored commands."""

import math

import torch
from mjlab.envs.mdp import terminations as mdp
from mjlab.managers.termination_manager import TerminationTermCfg

from pipeline.learning.robot_facts import RobotFacts
from pipeline.training.config import Config
from pipeline.training.masks import replace

MAX_TILT_DEG = 60.0
"""Tilt of a fall (paper); a root below the robot's `fall_height` is a fall too [deg]."""
STALL_SPEED, STALL_YAW = 0.2, 0.3
"""Speed [m/s] and yaw rate [rad/s] above which a command can count as ignored."""
STALL_SHARE = 0.3
"""The linear or the angular command counts as ignored if the robot achieves less than this share of it."""


def ignores_command(command: torch.Tensor, velocity: torch.Tensor) -> torch.Tensor:
    """Whether the robot ignores its linear or its angular command (n,).

    Args:
        command: forward, lateral [m/s], yaw rate [rad/s] (n, 3)
        velocity: achieved velocity on the same axes (n, 3)
    """
    speed = torch.linalg.norm(command[:, :2], dim=1)
    along = (velocity[:, :2] * command[:, :2]).sum(dim=1) / speed.clamp(min=1e-6)
    turn = command[:, 2].abs()
    turned = velocity[:, 2] * torch.sign(command[:, 2])
    no_move = (speed > STALL_SPEED) & (along < STALL_SHARE * speed)
    return no_move | ((turn > STALL_YAW) & (turned < STALL_SHARE * turn))


class Stalled:
    """Terminate an episode after the averaged velocity has ignored the command for `stall_s`."""

    def __init__(self, cfg: TerminationTermCfg, env):
        self._stall_s = env.context.config.simulation.stall_s
        self._seconds = torch.zeros(env.num_envs, device=env.device)
        env.restarts.append(self.restart)

    def __call__(self, env) -> torch.Tensor:
        ignored = ignores_command(env.command, env.robot_state.mean_velocity)
        ignored &= env.velocity_command.age > self._stall_s
        self._seconds.copy_(torch.where(ignored, self._seconds + env.step_dt, 0.0))
        return self._seconds > self._stall_s

    def restart(self, mask: torch.Tensor) -> None:
        """Reset the timers of environments in `mask` (n,)."""
        replace(self._seconds, mask, 0.0)


def termination_cfg(robot: RobotFacts, config: Config, distils: bool) -> dict[str, TerminationTermCfg]:
    """Falls, stalls (if enabled) and the time limit; in distillation, tracking failures and clip ends."""
    terms = {
        "tilt": TerminationTermCfg(func=mdp.bad_orientation, params={"limit_angle": math.radians(MAX_TILT_DEG)}),
        "height": TerminationTermCfg(func=mdp.root_height_below_minimum, params={"minimum_height": robot.fall_height}),
        "diverged": TerminationTermCfg(func=mdp.nan_detection),
        "time": TerminationTermCfg(func=mdp.time_out, time_out=True),
    }
    if distils:
        terms["tracking_failed"] = TerminationTermCfg(func=lambda env: env.teacher.tracking_failed)
        terms["clip_ended"] = TerminationTermCfg(func=lambda env: env.teacher.clip_ended, time_out=True)
    elif config.simulation.stall_s:
        terms["stalled"] = TerminationTermCfg(func=Stalled)
    return terms


FALLS = ("tilt", "height", "diverged")
"""Names of the fall terms."""


def fell(env) -> torch.Tensor:
    """Whether the episode terminates by a fall (n,)."""
    return torch.stack([env.termination_manager.get_term(name) for name in FALLS]).any(dim=0)


def ended_by(env, name: str) -> torch.Tensor:
    """Whether the episode ends by the term `name` (n,); False if the term is disabled."""
    if name not in env.termination_manager.active_terms:
        return torch.zeros_like(env.reset_buf)
    return env.termination_manager.get_term(name)
