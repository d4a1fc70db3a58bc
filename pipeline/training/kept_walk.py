"""Staying near what a policy that is gone on with does, ahead or unpushed, while it learns something else.

Where all that is asked for is less effort in turns and side steps, a change of the network for them changes the walk
ahead too, and rewards notice that late; where it is to catch pushes, the walk that nobody pushes changes. So the
divergence from the given policy is a loss of its own, in samples whose command is ahead, or that are not of somebody
who was just pushed: as Schmitt et al., "Kickstarting Deep Reinforcement Learning", 2018, hold a student to a teacher.
"""

from __future__ import annotations

import copy
from typing import Any, cast

import torch
from tensordict import TensorDict
from torch import nn

from pipeline.training.foresight import recovery_told
from pipeline.training.observations import newest_command

FULL = 0.6
"""A command that is as much more ahead than aside [m/s] is ahead altogether."""
TURN = 0.3
"""A yaw rate counts as this much of a lateral velocity [m]: about the distance of a foot from the middle."""


def ahead(command: torch.Tensor) -> torch.Tensor:
    """How much (n,) of commands (n, 3) is ahead, 0..1: nothing of turns on the spot, side steps and steps back."""
    return ((command[:, 0] - command[:, 1].abs() - TURN * command[:, 2].abs()) / FULL).clamp(0.0, 1.0)


def share_kept(of: str, obs: TensorDict) -> torch.Tensor:
    """How much (n,) of observations' walks is kept, 0..1: `ahead`, or all who are `unpushed`."""
    if of == "unpushed":
        return (recovery_told(cast(torch.Tensor, obs["critic"])) == 0.0).float()
    return ahead(newest_command(cast(torch.Tensor, obs["actor"])))


class KeptWalk:
    """The divergence from an actor as it is now, whose deviation is `std`, times `weight`, in what is kept `of` it."""

    def __init__(self, actor: nn.Module, std: float, weight: float, of: str = "ahead"):
        self._of = of
        self._actor = copy.deepcopy(actor).eval().requires_grad_(False)
        self._scale = weight / (2.0 * std**2)

    def loss(self, mean: torch.Tensor, obs: TensorDict) -> torch.Tensor:
        """Of the actor's mean actions (n, a) for observations (n,), averaged over all of them."""
        with torch.no_grad():
            given = cast(torch.Tensor, self._actor(cast(Any, obs)))
            share = share_kept(self._of, obs)
        return self._scale * (share * torch.square(mean - given).sum(dim=1)).mean()
