"""A teacher that walks another speed than it is told is told another one: by how fast it walks.

A policy learns the clips' steps sooner than their speed; one that is too fast by a tenth everywhere need not learn more
to be a teacher.
"""

from __future__ import annotations

import math
from itertools import pairwise

import torch

from pipeline.training.observations import COMMAND, HISTORY
from pipeline.training.training_error import TrainingError

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


def _pair(text: str) -> tuple[float, float]:
    told, walked = text.split(":")
    return float(told), float(walked)
