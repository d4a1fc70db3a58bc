"""Which expert frames are drawn, for windows of the discriminator and for the starts of episodes."""

from __future__ import annotations

import itertools

import numpy as np
import torch

from pipeline.training.bundle import ExpertFrames
from pipeline.training.commands import draw_commands
from pipeline.training.motion_features import frame_features, window_frames, window_span
from pipeline.training.options import Options

CELL = np.array([0.3, 0.3, 0.6])
"""Size of a command cell: forward and lateral [m/s], yaw rate [rad/s]."""
CHUNK = 10_000
"""Windows gathered at a time: all steps of 200,000 would take a gigabyte."""
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
    asked = asked_commands(CELL_SAMPLES, options, seed)
    nearest, member, count = _answers(expert, starts, asked)
    wanted = np.bincount(nearest, minlength=count) / len(asked)
    inside = np.bincount(member, weights=weight, minlength=count)
    result = weight / inside[member] * wanted[member]
    return result / result.sum()


def asked_commands(count: int, options: Options, seed: int) -> np.ndarray:
    """Commands (count, 3) as the policy gets them."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return draw_commands(count, options, "cpu").numpy()


def _answers(expert: ExpertFrames, starts: np.ndarray, asked: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """The cell that answers each of the asked commands, the cell that each start is in, and the number of cells."""
    known, member = np.unique(np.round(expert.command[starts] / CELL).astype(int), axis=0, return_inverse=True)
    chunks = np.array_split(asked / CELL, max(1, len(asked) // CELL_SAMPLES))
    nearest = [np.argmin(((chunk[:, None] - known[None]) ** 2).sum(axis=-1), axis=1) for chunk in chunks]
    return np.concatenate(nearest), member.ravel(), len(known)


def answering_starts(
    expert: ExpertFrames, starts: np.ndarray, asked: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """For each asked command a start of the nearest cell that has frames, drawn by the clips' weights."""
    weight = frame_weights(expert, starts)
    nearest, member, count = _answers(expert, starts, asked)
    drawn = np.empty(len(asked), dtype=int)
    for cell in range(count):
        wanted, inside = nearest == cell, member == cell
        share = weight[inside] / weight[inside].sum()
        drawn[wanted] = rng.choice(starts[inside], int(wanted.sum()), p=share)
    return drawn


def expert_windows(expert: ExpertFrames, options: Options, seed: int) -> torch.Tensor:
    """Feature windows (n, h, f), each of one clip; with `discriminator_command` each frame has the command after it.

    Drawn by cell, that is the command which the window answers, not the one its frames obey to the last digit: so that
    the commands alone are distributed as the policy's and tell nothing of where a window comes from.
    """
    span = window_span(options)
    starts = window_starts(expert, span)
    rng = np.random.default_rng(seed)
    if options.discriminator_command and options.expert_by_cell:
        command = asked_commands(options.expert_windows, options, seed)
        drawn = answering_starts(expert, starts, command, rng)
    else:
        by_cell = options.expert_by_cell
        weight = cell_weights(expert, starts, options, seed) if by_cell else frame_weights(expert, starts)
        drawn = rng.choice(starts, options.expert_windows, p=weight)
        command = expert.command[drawn + span // 2]
    features = frame_features(torch.from_numpy(expert.frames))
    windows = torch.cat(
        [
            window_frames(features[torch.from_numpy(part[:, None] + np.arange(span))], options)
            for part in np.array_split(drawn, max(1, len(drawn) // CHUNK))
        ]
    )
    if not options.discriminator_command:
        return windows
    given = torch.from_numpy(command).to(windows)[:, None].expand(-1, options.window, -1)
    return torch.cat([windows, given], dim=2)


class ReferenceStates:
    """Expert frames to begin episodes at."""

    def __init__(self, expert: ExpertFrames, options: Options, seed: int, device: str):
        starts = np.arange(len(expert.frames))
        by_cell = options.reference_by_cell
        weight = cell_weights(expert, starts, options, seed) if by_cell else frame_weights(expert, starts)
        self._weight = torch.from_numpy(np.cumsum(weight)).float().to(device)
        self._frames = torch.from_numpy(expert.frames).to(device)
        self._command = torch.from_numpy(expert.command).to(device)

    def draw(self, count: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Frames (count, c), the commands that they obey (count, 3), and which of the expert's they are (count,)."""
        at = torch.rand(count, device=self._weight.device)
        index = torch.searchsorted(self._weight, at).clamp(max=len(self._weight) - 1)
        return self._frames[index], self._command[index], index
