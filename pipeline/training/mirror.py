"""The mirror image of observations and actions, for rsl-rl's symmetry augmentation."""

from __future__ import annotations

from typing import Any, cast

import torch
from rsl_rl.extensions import Symmetry
from tensordict import TensorDict

from pipeline.learning.robot_facts import RobotFacts
from pipeline.training.kept_walk import KeptWalk
from pipeline.training.observations import HISTORY, newest_command


class Mirror:
    """Left and right swapped. Twice is the identity.

    `beyond` (k,): by what each number that the critic sees beyond the feet is multiplied.
    """

    def __init__(self, robot: RobotFacts, device: str, beyond: torch.Tensor | None = None):
        joints = robot.index(robot.policy_joints)
        partner = [robot.policy_joints.index(robot.joint_names[int(robot.mirror_index[joint])]) for joint in joints]
        count = len(joints)
        sign = torch.from_numpy(robot.mirror_sign[joints])
        gyro, gravity, command = ([-1, 1, -1], [1, -1, 1], [1, -1, -1])
        head = torch.tensor([*gyro, *gravity, *command], dtype=sign.dtype)
        at = torch.tensor(partner)
        index = torch.cat([torch.arange(9), 9 + at, 9 + count + at, 9 + 2 * count + at])
        frame_sign = torch.cat([head, sign, sign, sign])
        size = len(index)
        self._action = (at.to(device), sign.float().to(device))
        self._actor = (
            (index[None] + size * torch.arange(HISTORY)[:, None]).flatten().to(device),
            frame_sign.repeat(HISTORY).float().to(device),
        )
        base, feet = torch.tensor([1.0, -1.0, 1.0]), torch.ones(2)
        beyond = torch.zeros(0) if beyond is None else beyond.cpu()
        further = size + 5 + torch.arange(len(beyond))
        self._critic = (
            torch.cat([index, size + torch.arange(3), torch.tensor([size + 4, size + 3]), further]).to(device),
            torch.cat([frame_sign.float(), base, feet, beyond]).to(device),
        )

    def actions(self, actions: torch.Tensor) -> torch.Tensor:
        """Of actions (n, a) in the network's order."""
        return _mirrored(actions, self._action)

    def seen(self, seen: torch.Tensor) -> torch.Tensor:
        """Of what the actor sees (n, o)."""
        return _mirrored(seen, self._actor)

    def observations(self, obs: TensorDict) -> TensorDict:
        """Of the groups `actor` and `critic`."""
        both = {"actor": _mirrored(obs["actor"], self._actor), "critic": _mirrored(obs["critic"], self._critic)}
        return TensorDict(cast(Any, both), batch_size=obs.batch_size)


def _mirrored(value: torch.Tensor, how: tuple[torch.Tensor, torch.Tensor]) -> torch.Tensor:
    index, sign = how
    return value[:, index] * sign


class MirroredSamples(Symmetry):
    """rsl-rl's symmetry without the figure of it, for which the network would be worked out once more a mini-batch.

    In its place in the loss, which rsl-rl adds with weight 1, is a `KeptWalk` where there is one.
    """

    kept: KeptWalk | None = None

    def keep(self, kept: KeptWalk) -> None:
        """Add a loss from now on."""
        self.kept, self.use_mirror_loss, self.mirror_loss_coeff = kept, True, 1.0

    def compute_loss(self, actor: Any, batch: Any, original_batch_size: int) -> torch.Tensor:
        """That of the walk that is kept, of the samples that are no mirror images; else 0."""
        if self.kept is None:
            return torch.zeros((), device=batch.actions.device)
        own = slice(0, original_batch_size)
        return self.kept.loss(actor.output_mean[own], batch.observations[own])


def stands(obs: TensorDict) -> torch.Tensor:
    """Whether (n,) the newest command is to stand."""
    return (newest_command(cast(torch.Tensor, obs["actor"])) == 0.0).all(dim=1)


def augment(env, obs: TensorDict, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor]:
    """The samples and after them their mirror images, as rsl-rl asks for it; `env.mirror` knows the robot.

    Where `mirror_standing` is off, samples that are told to stand come twice as they are.
    """
    mirror: Mirror = env.mirror
    other_obs, other_actions = mirror.observations(obs), mirror.actions(actions)
    if not env.unwrapped.context.options.mirror_standing:
        same = stands(obs)[:, None]
        other_actions = torch.where(same, actions, other_actions)
        other_obs = TensorDict(
            {name: torch.where(same, obs[name], other_obs[name]) for name in ("actor", "critic")},
            batch_size=obs.batch_size,
        )
    return cast(TensorDict, torch.cat([cast(Any, obs), other_obs])), torch.cat([actions, other_actions])
