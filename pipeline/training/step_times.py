"""How long the expert's clips take for a step, by the command that they obey."""

from __future__ import annotations

import itertools

import numpy as np
import torch

from pipeline.training.bundle import FPS, ExpertFrames
from pipeline.training.expert_sampling import CELL
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
    w, x, y, z = frames[:, 3:7].T
    up = np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)], axis=1)
    joints = (frames.shape[1] - 37) // 2
    feet = frames[:, 7 + joints + 6 : 7 + joints + 12].reshape(-1, 2, 3)
    return frames[:, 2:3] + np.einsum("tk,tfk->tf", up, feet)


class StepTimes:
    """The clips' median time of a step for any command: that of the nearest cell which has steps."""

    def __init__(self, expert: ExpertFrames, device: str):
        end, seconds = steps(expert)
        cells, member, count = np.unique(
            np.round(expert.command[end] / CELL).astype(int), axis=0, return_inverse=True, return_counts=True
        )
        taken = np.flatnonzero(count >= LEAST_STEPS)
        median = [np.median(seconds[member.ravel() == cell]) for cell in taken]
        self._cells = torch.from_numpy(cells[taken]).float().to(device)
        self._size = torch.from_numpy(CELL).float().to(device)
        self._seconds = torch.tensor(np.array(median), dtype=torch.float32, device=device)

    def __call__(self, command: torch.Tensor) -> torch.Tensor:
        """Seconds (n,) for commands (n, 3); 0 where no clip steps."""
        if not len(self._seconds):
            return torch.zeros(len(command), device=command.device)
        away = torch.cdist(command / self._size, self._cells)
        return self._seconds[away.argmin(dim=1)]
