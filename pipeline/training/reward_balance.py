"""What each term of the reward pays a robot that stands and one that walks.

Each starts near the default pose and is told a command at once; the table has the discounted return of each term until
the episode's end, or what `seconds` give of it. A robot that stands keeps the default pose until it stalls. A policy
can be told another command than the reward is given for, so that it walks at the speed that is asked for: what is
compared are motions, not policies. Nothing is random here but the start: no noise, no pushes, nominal motors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
import torch

from pipeline.learning.policy_file import act
from pipeline.training.bundle import Bundle
from pipeline.training.environment import AmpEnvironment
from pipeline.training.observations import HISTORY
from pipeline.training.options import Options
from pipeline.training.pushes import FORCE_S
from pipeline.training.reward_row import FALL
from pipeline.training.reward_terms import joint_tracking, tracking
from pipeline.training.terminations import stands_though_told

DISCOUNT = 0.99
"""Of the return, each control step; PPO's."""
CONTROL_S = 0.02
PUSHED_S = 1.0
COMMANDS = ((0.3, 0, 0), (-0.3, 0, 0), (0, 0.3, 0), (0.6, 0, 0), (1.0, 0, 0), (2.0, 0, 0), (-0.6, 0, 0), (0, 0.6, 0))
COMMANDS += ((0, 0, 1.0), (0, 0, 0))
"""Forward, lateral [m/s], yaw rate [rad/s]."""
NOMINAL = {
    "noise": (0.0, 0.0, 0.0, 0.0),
    "push_speed": (0.0, 0.0),
    "push_impulse": (0.0, 0.0),
    "gain_range": (1.0, 1.0),
    "trunk_density": (0.0, 0.0),
    "friction": (0.8, 0.8),
    "action_lag_steps": 0,
    "reference_share": 0.0,
    "tracked": 0.0,
    "assist": 0.0,
    "resample_s": (1000.0, 1000.0),
    "terrain": "plane",
    "slope_share": 0.0,
    "slew_share": 0.0,
    "rotor_link_share": 0.0,
}
"""Options without which nothing is random but the start."""

Controller = Callable[[torch.Tensor], torch.Tensor]
"""Observations (n, o) to actions (n, a)."""


@dataclass(frozen=True, kw_only=True)
class Paid:
    """What one robot was paid for one command."""

    command: tuple[float, float, float]
    velocity: tuple[float, float, float]
    """Mean of the last second."""
    seconds: float
    """Until it fell, stalled, or the time was up."""
    ended: str
    """`fell`, `stalled` or `time`."""
    terms: dict[str, float]
    """Term: its discounted return."""

    @property
    def total(self) -> float:
        """Discounted return."""
        return sum(self.terms.values())


def nominal_environment(bundle: Bundle, options: Options, count: int, seed: int = 1) -> AmpEnvironment:
    """An environment of `count` robots in which nothing is random but the start; schedules are at their end."""
    env = AmpEnvironment(bundle, options.changed(**NOMINAL), count, "cpu", seed)
    env.schedule = 1e9
    return env


def stands(observation: torch.Tensor) -> torch.Tensor:
    """The default pose, whatever is seen."""
    return torch.zeros(len(observation), (observation.shape[1] // HISTORY - 9) // 3)


def walks(arrays: dict[str, np.ndarray], told: torch.Tensor) -> Controller:
    """A policy that is told `told` (n, 3) whatever the command is."""

    def controller(observation: torch.Tensor) -> torch.Tensor:
        frames = observation.reshape(len(observation), HISTORY, -1).clone()
        frames[..., 6:9] = torch.where((frames != 0.0).any(dim=2, keepdim=True), told[:, None], 0.0)
        return act(arrays, frames.flatten(1))

    return controller


def standing_pays(options: Options, commands: torch.Tensor) -> torch.Tensor:
    """The most (n,) that standing still can be paid for commands (n, 3), in closed form: every reward of a robot that
    does not move and no penalty but the stall's, until a stall ends it, or for ever where it does not count as one."""
    still = torch.zeros_like(commands)
    split = 3.0 * (1.0 - options.tracking_product) * tracking(commands, still, options.sigma2).sum(dim=1)
    product = 9.0 * options.tracking_product * joint_tracking(commands, still, options.product_sigma2)
    late = options.mean_tracking * joint_tracking(commands, still, options.mean_sigma2)
    stalls = options.stall & stands_though_told(commands, still, options)
    steps = torch.where(stalls, round(2.0 * options.stall_s / CONTROL_S) + 1, 1_000_000)
    lasting = CONTROL_S * (1.0 - DISCOUNT**steps) / (1.0 - DISCOUNT)
    end = DISCOUNT**steps * stalls * -FALL * options.fall_factor * options.stall_penalty * CONTROL_S
    return (split + product + late) * lasting - end


def play(
    env: AmpEnvironment,
    controller: Controller,
    commands: torch.Tensor,
    seconds: float,
    push: float = 0.0,
) -> tuple[Paid, ...]:
    """Let every robot live through its command (n, 3); what it was paid.

    `push` is a push forward at PUSHED_S [N s], as a force of FORCE_S on the trunk.
    """
    observation, _ = env.reset()
    env.velocity_command.give(torch.arange(env.num_envs), commands)
    task = env.reward_manager.get_term_cfg("task").func
    terms = torch.zeros(env.num_envs, len(task.rows))
    alive = torch.ones(env.num_envs, dtype=torch.bool)
    ended, lived = ["time"] * env.num_envs, torch.zeros(env.num_envs)
    recent: list[torch.Tensor] = []
    for step in range(round(seconds / env.step_dt)):
        if push:
            on = PUSHED_S <= step * env.step_dt < PUSHED_S + FORCE_S
            env.trunk_forces.push_w[:, 0] = push / FORCE_S * on
        seen = cast(torch.Tensor, observation["actor"])
        observation, *_ = env.step(controller(seen))
        terms += DISCOUNT**step * env.step_dt * task.paid * alive[:, None]
        lived += env.step_dt * alive
        recent = [*recent[-49:], env.readings.velocity.clone()]
        for name, over in (("fell", env.fell), ("stalled", env.stalled)):
            for at in (over & alive).nonzero().flatten().tolist():
                ended[at] = name
        alive &= ~(env.fell | env.stalled)
        if not alive.any():
            break
    mean = torch.stack(recent).mean(dim=0)
    return tuple(
        Paid(
            command=tuple(commands[at].tolist()),
            velocity=tuple(mean[at].tolist()),
            seconds=float(lived[at]),
            ended=ended[at],
            terms=dict(zip((row.name for row in task.rows), terms[at].tolist(), strict=True)),
        )
        for at in range(env.num_envs)
    )
