"""How long the expert's clips take for a step, by the command that they obey."""

from __future__ import annotations

import itertools

import numpy as np
import torch

from pipeline.training.bundle import FPS, ExpertFrames
from pipeline.training.command_cells import CommandCells
from pipeline.training.motion_features import up_b
from pipeline.training.plain_walk import AIR_S

LIFTED_M = 0.012
"""A sole's middle is this much higher than it usually is on the ground while its foot swings [m]."""
GROUND_PERCENTILE = 5.0
LEAST_STEPS = 6
"""A cell with fewer steps is left out."""


def steps(expert: ExpertFrames) -> tuple[np.ndarray, np.ndarray]:
    """The frame (k,) at which each step ends, and how long it took since the other foot was set down (k,) [s]."""
    height = _sole_heights(expert.frames)
    found: list[tuple[int, float]] = []
    for first, last in itertools.pairwise(expert.clip_start):
        inside = height[first:last]
        lifted = inside > np.percentile(inside, GROUND_PERCENTILE, axis=0) + LIFTED_M
        landed = sorted((at, foot) for foot in (0, 1) for at in _landings(lifted[:, foot]))
        found += [
            (first + at, (at - before) / FPS)
            for (before, other), (at, foot) in itertools.pairwise(landed)
            if foot != other and at > before
        ]
    if not found:
        return np.zeros(0, dtype=int), np.zeros(0)
    end, took_s = zip(*found, strict=True)
    return np.array(end), np.array(took_s)


def _landings(lifted: np.ndarray) -> list[int]:
    """Frames at which a foot is on the ground after a swing."""
    change = np.flatnonzero(np.diff(lifted.astype(int)))
    begins, stops = change[~lifted[change]], change[lifted[change]]
    stops = stops[stops > begins[0]] if len(begins) else stops[:0]
    return [int(b) + 1 for a, b in zip(begins, stops, strict=False) if (b - a) / FPS >= AIR_S - 1e-9]


def _sole_heights(frames: np.ndarray) -> np.ndarray:
    """Of the left and right sole's middle above the ground (t, 2) [m]."""
    up = up_b(torch.from_numpy(frames[:, 3:7])).numpy()
    joints = (frames.shape[1] - 37) // 2
    feet = frames[:, 7 + joints + 6 : 7 + joints + 12].reshape(-1, 2, 3)
    return frames[:, 2:3] + np.einsum("tk,tfk->tf", up, feet)


class StepTimes:
    """The clips' median time of a step for any command: that of the nearest cell which has steps."""

    def __init__(self, expert: ExpertFrames, device: str):
        end, seconds = steps(expert)
        self._cells = CommandCells(expert.command[end], LEAST_STEPS, device)
        median = [np.median(seconds[member]) for member in self._cells.members]
        self._seconds = torch.tensor(np.array(median), dtype=torch.float32, device=device)

    def __call__(self, command: torch.Tensor) -> torch.Tensor:
        """Seconds (n,) for commands (n, 3); 0 where no clip steps."""
        if not len(self._seconds):
            return torch.zeros(len(command), device=command.device)
        return self._seconds[self._cells.nearest(command)]
