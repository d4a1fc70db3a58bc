"""When an episode ends before its time. Falls are mjlab's terms; only ignoring the command is ours."""

import math

import torch
from mjlab.envs.mdp import terminations as mdp
from mjlab.managers.termination_manager import TerminationTermCfg

from pipeline.learning.robot_facts import RobotFacts
from pipeline.training.config import Config
from pipeline.training.masks import replace

MAX_TILT_DEG = 60.0
"""A fall (paper), beside a root below the robot's `fall_height`."""
STALL_SPEED, STALL_YAW = 0.2, 0.3
"""Speed [m/s] and yaw rate [rad/s] above which a command can count as ignored."""
STALL_SHARE = 0.3
"""A half of the command, moving or turning, counts as ignored where the robot reaches less than this share of it."""


def ignores_command(command: torch.Tensor, velocity: torch.Tensor) -> torch.Tensor:
    """Whether the robot ignores one half of its command (n,): moving or turning, each if commanded.

    Args:
        command: forward, lateral [m/s], yaw rate [rad/s] (n, 3)
        velocity: the same of the robot (n, 3)
    """
    speed = torch.linalg.norm(command[:, :2], dim=1)
    along = (velocity[:, :2] * command[:, :2]).sum(dim=1) / speed.clamp(min=1e-6)
    turn = command[:, 2].abs()
    turned = velocity[:, 2] * torch.sign(command[:, 2])
    no_move = (speed > STALL_SPEED) & (along < STALL_SHARE * speed)
    return no_move | ((turn > STALL_YAW) & (turned < STALL_SHARE * turn))


class Stalled:
    """Ends an episode in which the command has been ignored for `stall_s`, by the averaged velocity."""

    def __init__(self, cfg: TerminationTermCfg, env):
        self._stall_s = env.context.config.simulation.stall_s
        self._seconds = torch.zeros(env.num_envs, device=env.device)
        env.restarts.append(self.restart)

    def __call__(self, env) -> torch.Tensor:
        stalls = ignores_command(env.command, env.robot_state.mean_velocity)
        stalls &= env.velocity_command.age > self._stall_s
        self._seconds.copy_(torch.where(stalls, self._seconds + env.step_dt, 0.0))
        return self._seconds > self._stall_s

    def restart(self, mask: torch.Tensor) -> None:
        """Reset the time of environments (n,) that begin an episode."""
        replace(self._seconds, mask, 0.0)


def termination_cfg(robot: RobotFacts, config: Config, distils: bool) -> dict[str, TerminationTermCfg]:
    """Falls, stalls where they are on, and the end of the time; in distillation also the clip's end and losing it."""
    terms = {
        "tilt": TerminationTermCfg(func=mdp.bad_orientation, params={"limit_angle": math.radians(MAX_TILT_DEG)}),
        "height": TerminationTermCfg(func=mdp.root_height_below_minimum, params={"minimum_height": robot.fall_height}),
        "diverged": TerminationTermCfg(func=mdp.nan_detection),
        "time": TerminationTermCfg(func=mdp.time_out, time_out=True),
    }
    if distils:
        terms["clip_lost"] = TerminationTermCfg(func=lambda env: env.teacher.lost)
        terms["clip_ended"] = TerminationTermCfg(func=lambda env: env.teacher.ended, time_out=True)
    elif config.simulation.stall_s:
        terms["stalled"] = TerminationTermCfg(func=Stalled)
    return terms


FALLS = ("tilt", "height", "diverged")
"""Terms that are falls."""


def fell(env) -> torch.Tensor:
    """Whether the episode ends by a fall (n,)."""
    return torch.stack([env.termination_manager.get_term(name) for name in FALLS]).any(dim=0)


def ended_by(env, name: str) -> torch.Tensor:
    """Whether the episode ends by a term (n,); False where the term is off."""
    if name not in env.termination_manager.active_terms:
        return torch.zeros_like(env.reset_buf)
    return env.termination_manager.get_term(name)
