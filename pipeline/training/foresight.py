"""What happens to each environment whatever its robot does: the next push and command, how the ground slopes, where
its rotors are.

Only the critic may be told. Returns differ by who is pushed over; a critic that knows the push ahead takes that
from the advantages, and as no action changes it, their mean stays what it was: an input-dependent baseline (Mao et al.,
"Variance Reduction for Reinforcement Learning in Input-Driven Environments", ICLR 2019).
"""

from __future__ import annotations

import torch

from pipeline.training.pushes import recovery_left

AHEAD_S = 3.0
"""How far ahead [s]; rewards count 1/e as much for every 2 s."""


def foreseen(env) -> torch.Tensor:
    """Of each kind of push (n, 4): nearness in time 1..0, its vector in the frame of the heading times that, and
    whether there is one at all; the force that acts now (n, 2) [N]; of the next command (n, 4): its nearness in time,
    and what it adds to the one of now, times that. Nothing of the next command is told where a clip is tracked. Where
    there are slopes, which way the ground falls (n, 2), as its sine; where commands are slewed, how far they still
    have to go (n, 3); where rotors are on links, their share (n, 1); where a push may be caught at no cost, how
    much of that time is left (n, 1)."""
    pushes = [part for coming in env.coming_pushes for part in _of_push(coming, env.readings.heading_w)]
    acting = _from_heading(env.trunk_forces.push_w, env.readings.heading_w)
    slope = [] if env.slopes is None else [_from_heading(env.slopes.down_w, env.readings.heading_w)]
    slewed = [env.velocity_command.goal - env.command] if env.context.options.slew_share else []
    rotors = [env.rotor_link_share[:, None]] if env.context.options.rotor_link_share else []
    recovery_s = env.context.options.recovery_s
    recovery = [recovery_left(env, recovery_s)[:, None]] if recovery_s else []
    return torch.cat([*pushes, acting, *_of_command(env), *slope, *slewed, *rotors, *recovery], dim=1)


def recovery_told(critic: torch.Tensor) -> torch.Tensor:
    """How much (n,) of the time to recover from a push is left, of what a critic (n, c) with foresight sees."""
    return critic[:, -1]


def signs(env) -> torch.Tensor:
    """By what each of these numbers is multiplied in a mirror (k,)."""
    push, acting, command = [1.0, 1.0, -1.0, 1.0], [1.0, -1.0], [1.0, 1.0, -1.0, -1.0]
    slope = [] if env.slopes is None else [1.0, -1.0]
    slewed = [1.0, -1.0, -1.0] if env.context.options.slew_share else []
    rotors = [1.0] if env.context.options.rotor_link_share else []
    recovery = [1.0] if env.context.options.recovery_s else []
    return torch.tensor([*push * len(env.coming_pushes), *acting, *command, *slope, *slewed, *rotors, *recovery])


def _near(left_s: torch.Tensor) -> torch.Tensor:
    return (1.0 - left_s / AHEAD_S).clamp(0.0, 1.0)[:, None]


def _of_push(coming, heading_w: torch.Tensor) -> tuple[torch.Tensor, ...]:
    near, push_w = _near(coming.left_s), coming.push_w
    return near, near * _from_heading(push_w, heading_w), (push_w != 0.0).any(dim=1, keepdim=True).float()


def _from_heading(vector_w: torch.Tensor, heading_w: torch.Tensor) -> torch.Tensor:
    """Horizontal vectors (n, 3) of the world, ahead and to the left of the heading (n, 2)."""
    (x, y, _), (cos, sin) = vector_w.unbind(dim=1), heading_w.unbind(dim=1)
    return torch.stack([x * cos + y * sin, y * cos - x * sin], dim=1)


def _of_command(env) -> tuple[torch.Tensor, torch.Tensor]:
    """Nearness in time (n, 1) of the next command, and its difference from that of now times it (n, 3)."""
    term, near = env.velocity_command, _near(env.velocity_command.time_left)
    if env.tracked_clip is not None:
        near = near * ~env.tracked_clip.tracks[:, None]
    return near, near * (term.coming - term.command)
