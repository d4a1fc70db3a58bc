"""Mirror images of observations and actions, for rsl_rl's symmetry augmentation and for distillation."""

from typing import Any, cast

import torch
from rsl_rl.extensions import Symmetry
from tensordict import TensorDict

from pipeline.learning.robot_facts import RobotFacts
from pipeline.training.mdp.observations import HISTORY

LESS_PROBABLE = 20.0
"""Mirrored samples whose log probability is lower than the original's by more than this [nat] are ignored: the policy
would never act so there, and beyond 88 nat the ratio overflows."""
NO_WEIGHT = 1e3
"""Old log probability for which the ratio, and with it the gradient, is 0."""


class Mirror:
    """Left-right mirroring; applied twice it is the identity."""

    def __init__(self, robot: RobotFacts, device: str):
        joints = robot.index(robot.policy_joints)
        partner = [robot.policy_joints.index(robot.joint_names[int(robot.mirror_index[joint])]) for joint in joints]
        count = len(joints)
        sign = torch.from_numpy(robot.mirror_sign[joints])
        gyro, gravity, command = ([-1, 1, -1], [1, -1, 1], [1, -1, -1])
        head = torch.tensor([*gyro, *gravity, *command], dtype=sign.dtype)
        joint = torch.tensor(partner)
        index = torch.cat([torch.arange(9), 9 + joint, 9 + count + joint, 9 + 2 * count + joint])
        frame_sign = torch.cat([head, sign, sign, sign])
        size = len(index)
        self._action = (joint.to(device), sign.float().to(device))
        self._actor = (
            (index[None] + size * torch.arange(HISTORY)[:, None]).flatten().to(device),
            frame_sign.repeat(HISTORY).float().to(device),
        )
        base, planar, feet = torch.tensor([1.0, -1.0, 1.0]), torch.tensor([1.0, -1.0, -1.0]), torch.ones(2)
        self._critic = (
            torch.cat([index, size + torch.arange(6), torch.tensor([size + 7, size + 6])]).to(device),
            torch.cat([frame_sign.float(), base, planar, feet]).to(device),
        )

    def actions(self, actions: torch.Tensor) -> torch.Tensor:
        """Mirror actions (n, a) in the network's order."""
        return _mirrored(actions, self._action)

    def actor(self, observation: torch.Tensor) -> torch.Tensor:
        """Mirror actor observations (n, o)."""
        return _mirrored(observation, self._actor)

    def observations(self, obs: TensorDict) -> TensorDict:
        """Mirror the observation groups `actor` and `critic`."""
        both = {"actor": _mirrored(obs["actor"], self._actor), "critic": _mirrored(obs["critic"], self._critic)}
        return TensorDict(cast(Any, both), batch_size=obs.batch_size)


def _mirrored(value: torch.Tensor, how: tuple[torch.Tensor, torch.Tensor]) -> torch.Tensor:
    index, sign = how
    return value[:, index] * sign


class MirroredSamples(Symmetry):
    """rsl_rl's symmetry augmentation with correct old log probabilities of mirrored samples.

    rsl_rl reuses the original's log probability, which holds only for a symmetric policy. A distilled actor's mean
    differs from the mirrored one by half a std or more; the ratios of nearly all mirrored samples would then exceed
    the clip range, up to e^50, and dominate the update.
    """

    def augment_batch(self, batch: Any, original_batch_size: int) -> None:
        """Append mirrored samples; `batch.old_actions_log_prob` has the columns original and mirrored."""
        both = batch.old_actions_log_prob
        super().augment_batch(batch, original_batch_size)
        own, mirrored = both[:, :1], both[:, 1:]
        batch.old_actions_log_prob = torch.cat([own, torch.where(mirrored < own - LESS_PROBABLE, NO_WEIGHT, mirrored)])

    def compute_loss(self, actor: Any, batch: Any, original_batch_size: int) -> torch.Tensor:
        """Return 0: the mirror loss is not used, and computing it costs one network evaluation per mini-batch."""
        return torch.zeros((), device=batch.actions.device)


def augment(env, obs: TensorDict, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor]:
    """Append the mirrored samples, as rsl_rl's `data_augmentation_func`."""
    mirror: Mirror = env.mirror
    both = torch.cat([cast(Any, obs), mirror.observations(obs)])
    return cast(TensorDict, both), torch.cat([actions, mirror.actions(actions)])
