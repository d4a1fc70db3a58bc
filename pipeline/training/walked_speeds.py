"""A teacher that walks another speed than it is told is told another one: by how fast it walks.

A policy learns the clips' steps sooner than their speed; one that is too fast by a tenth everywhere need not learn more
to be a teacher. Nor need one that slopes make faster or slower: it can be told the error as well.
"""

from __future__ import annotations

import math
from itertools import pairwise

import torch

from pipeline.learning.training_error import TrainingError
from pipeline.training.observations import COMMAND, HISTORY

FORWARD = COMMAND.start
"""Where the forward velocity is in a frame."""


class WalkedSpeeds:
    """Pairs of what a policy is told and walks [m/s], from 0 on; between them straight lines, beyond the last one the
    same share more or less."""

    def __init__(self, text: str):
        """From `told:walked,told:walked,…`. Raises TrainingError where both do not grow from 0 on."""
        try:
            pairs = [(0.0, 0.0), *(_pair(part) for part in text.split(","))]
        except ValueError as error:
            raise TrainingError(f"--walks is '{text}'; it must look like .6:.7,1.0:1.1 (told:walked).") from error
        if not all(a[0] < b[0] < math.inf and a[1] < b[1] < math.inf for a, b in pairwise(pairs)):
            raise TrainingError(f"--walks is '{text}'; what is told and what is walked must grow from pair to pair.")
        self._told, self._walked = (torch.tensor(column) for column in zip(*pairs, strict=True))

    def told_for(self, speed: torch.Tensor) -> torch.Tensor:
        """What to tell the policy so that it walks at a speed; backwards it is told the speed itself."""
        told, walked = self._told.to(speed), self._walked.to(speed)
        at = torch.bucketize(speed.contiguous(), walked[1:-1])
        slope = (told[1:] - told[:-1]) / (walked[1:] - walked[:-1])
        inside = told[at] + slope[at] * (speed - walked[at])
        inside = torch.where(speed > walked[-1], speed * told[-1] / walked[-1], inside)
        return torch.where(speed > 0.0, inside, speed)

    def seen_as(self, observation: torch.Tensor) -> torch.Tensor:
        """What the policy is to see in place of what an actor sees (n, o)."""
        frames = observation.unflatten(1, (HISTORY, -1)).clone()
        frames[:, :, FORWARD] = self.told_for(frames[:, :, FORWARD])
        return frames.flatten(1)


GAIN = 1.5
"""How much of a velocity error is told on top of the command."""
MOST = (0.35, 0.2, 0.3)
"""Most that is told on top [m/s, m/s, rad/s]: aside and in turns as much as teachers of the walk ahead were told."""


def corrected(observation: torch.Tensor, error: torch.Tensor) -> torch.Tensor:
    """What the actor sees (n, o) with commands that make up for what the averaged velocity lacks of them (n, 3): down
    a slope a walk is told less. Robots that stand are told what they were."""
    most = torch.tensor(MOST, device=error.device)
    frames = observation.unflatten(1, (HISTORY, -1)).clone()
    told = frames[:, :, COMMAND]
    more = (GAIN * error).clamp(-most, most)[:, None] * (told != 0.0).any(dim=2, keepdim=True)
    frames[:, :, COMMAND] = told + more
    return frames.flatten(1)


def _pair(text: str) -> tuple[float, float]:
    told, walked = text.split(":")
    return float(told), float(walked)
