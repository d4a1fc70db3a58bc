"""Which expert frames are drawn, for windows of the discriminator and for the starts of episodes."""

from __future__ import annotations

import itertools

import numpy as np
import torch

from pipeline.training.bundle import ExpertFrames
from pipeline.training.commands import draw_commands
from pipeline.training.motion_features import frame_features
from pipeline.training.options import Options

CELL = np.array([0.3, 0.3, 0.6])
"""Size of a command cell: forward and lateral [m/s], yaw rate [rad/s]."""
CELL_SAMPLES = 20_000
"""Commands drawn to find how often each cell is asked for."""


def window_starts(expert: ExpertFrames, span: int) -> np.ndarray:
    """Frames at which a window of `span` frames begins and stays within its clip."""
    start = expert.clip_start
    return np.concatenate([np.arange(a, b - span + 1) for a, b in itertools.pairwise(start)])


def frame_weights(expert: ExpertFrames, starts: np.ndarray) -> np.ndarray:
    """How often each of the starts is drawn: a clip by its MotionWeight, then a frame of it evenly."""
    clip = np.searchsorted(expert.clip_start, starts, side="right") - 1
    count = np.bincount(clip, minlength=len(expert.clip_weight))
    weight = expert.clip_weight[clip] / count[clip]
    return weight / weight.sum()


def cell_weights(expert: ExpertFrames, starts: np.ndarray, options: Options, seed: int) -> np.ndarray:
    """The same, so that the frames' commands are distributed as the policy's are.

    Each command that the policy may get is answered by the nearest cell that has frames; within a cell the clips'
    weights decide.
    """
    weight = frame_weights(expert, starts)
    cells = np.round(expert.command[starts] / CELL).astype(int)
    known, member = np.unique(cells, axis=0, return_inverse=True)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        asked = draw_commands(CELL_SAMPLES, options, "cpu").numpy() / CELL
    nearest = np.argmin(((asked[:, None] - known[None]) ** 2).sum(axis=-1), axis=1)
    wanted = np.bincount(nearest, minlength=len(known)) / len(asked)
    inside = np.bincount(member.ravel(), weights=weight, minlength=len(known))
    result = weight / inside[member.ravel()] * wanted[member.ravel()]
    return result / result.sum()


def expert_windows(expert: ExpertFrames, options: Options, seed: int) -> torch.Tensor:
    """Feature windows (n, h, f), each of one clip."""
    span = (options.window - 1) * options.window_stride + 1
    starts = window_starts(expert, span)
    by_cell = options.expert_by_cell
    weight = cell_weights(expert, starts, options, seed) if by_cell else frame_weights(expert, starts)
    drawn = np.random.default_rng(seed).choice(starts, options.expert_windows, p=weight)
    rows = drawn[:, None] + options.window_stride * np.arange(options.window)
    return frame_features(torch.from_numpy(expert.frames))[torch.from_numpy(rows)]


class ReferenceStates:
    """Expert frames to begin episodes at."""

    def __init__(self, expert: ExpertFrames, options: Options, seed: int, device: str):
        starts = window_starts(expert, 1)
        by_cell = options.reference_by_cell
        weight = cell_weights(expert, starts, options, seed) if by_cell else frame_weights(expert, starts)
        self._weight = torch.from_numpy(np.cumsum(weight)).float().to(device)
        self._frames = torch.from_numpy(expert.frames).to(device)
        self._command = torch.from_numpy(expert.command).to(device)

    def draw(self, count: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Frames (count, c) and the commands that they obey (count, 3)."""
        at = torch.rand(count, device=self._weight.device)
        index = torch.searchsorted(self._weight, at).clamp(max=len(self._weight) - 1)
        return self._frames[index], self._command[index]
