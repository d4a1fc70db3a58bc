"""The clip that an episode began in, followed for as long as its command holds: how near the robot stays to it.

The clip's time goes with the robot's: every few steps the nearest of its frames just before and after is taken, so that
a gait of nearly the clip's rate stays with it. Who stands still is left behind: the mean posture of the shipped clips
of .6, 1.0, 1.5 and 2.0 m/s is .35, .25, .26 and .21 near them.
"""

from __future__ import annotations

import itertools

import numpy as np
import torch

from pipeline.training.bundle import FPS, ExpertFrames

JOINTS, ENDS = 0.5, 0.05
"""Sums of squared differences at which nearness has fallen to a half: of joints [rad^2], of hands and feet [m^2]."""
LEFT_S = 1.0
"""The clip's end is told from so long before it [s]."""
AGAIN = 4
"""Control steps after which the nearest frame is looked for: the clip's time runs at .75 to 1.25 of its own."""


def nearness(
    joints: torch.Tensor, ends: torch.Tensor, like_joints: torch.Tensor, like_ends: torch.Tensor
) -> torch.Tensor:
    """1 / (1 + sum dq^2 / JOINTS + sum dp^2 / ENDS) of joints (…, a) [rad] and ends in the trunk's frame (…, 12) [m].

    It leads from far off too: a run's frames are 10 from the default pose.
    """
    away = torch.square(joints - like_joints).sum(dim=-1) / JOINTS + torch.square(ends - like_ends).sum(dim=-1) / ENDS
    return 1.0 / (1.0 + away)


class FollowedClip:
    """Where in its clip each of N environments is."""

    def __init__(self, expert: ExpertFrames, count: int, device: str):
        joints = expert.controlled
        frames = torch.from_numpy(expert.frames).to(device)
        self._joints, self._ends = frames[:, 7 : 7 + joints], frames[:, 7 + joints : 19 + joints]
        last = np.concatenate([np.full(b - a, b - 1) for a, b in itertools.pairwise(expert.clip_start)])
        self._last = torch.from_numpy(last).to(device)
        self._at = torch.zeros(count, dtype=torch.long, device=device)
        self._steps = 0
        self.follows = torch.zeros(count, dtype=torch.bool, device=device)
        """Which environments still have a clip."""
        self.near = torch.zeros(count, device=device)
        """How near each is to its clip, 0..1; 0 where it has none."""

    @property
    def left_s(self) -> torch.Tensor:
        """How long each still has its clip [s], at most LEFT_S (n,)."""
        return ((self._last[self._at] - self._at) / FPS).clamp(max=LEFT_S) * self.follows

    def begin(self, env_ids: torch.Tensor, at: torch.Tensor, follows: torch.Tensor) -> None:
        """Episodes begin at the frames `at` of the expert; `follows` says which of them have their clip's command."""
        self._at[env_ids], self.follows[env_ids] = at, follows
        self.near[env_ids] = follows.float()

    def advance(self, joints: torch.Tensor, ends_b: torch.Tensor, keeps: torch.Tensor) -> None:
        """A control step further, with joints (n, a), ends in the trunk's frame (n, 12), and who keeps its command."""
        self._steps += 1
        last = self._last[self._at]
        self.follows &= keeps & (self._at < last)
        at = torch.minimum(self._at + 1, last)
        if self._steps % AGAIN == 0:
            around = torch.stack([at - 1, at, torch.minimum(at + 1, last)], dim=1)
            each = nearness(joints[:, None], ends_b[:, None], self._joints[around], self._ends[around])
            at = around.gather(1, each.argmax(dim=1, keepdim=True))[:, 0]
        self._at = at
        near = nearness(joints, ends_b, self._joints[at], self._ends[at])
        self.near = torch.nan_to_num(near) * self.follows
