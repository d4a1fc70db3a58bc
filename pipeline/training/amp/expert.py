"""Expert frames as they are drawn: windows for the discriminator, and start states of episodes."""

import itertools

import numpy as np
import torch

from pipeline.training.amp.features import frame_features
from pipeline.training.bundle import ExpertFrames
from pipeline.training.config import CommandsConfig, Config
from pipeline.training.mdp.commands import draw_commands

CELL = np.array([0.3, 0.3, 0.6])
"""Size of a command cell: forward and lateral [m/s], yaw rate [rad/s]."""
CHUNK = 10_000
"""Windows gathered at a time, to bound memory."""
CELL_SAMPLES = 20_000
"""Commands drawn to find the share of each cell."""
WINDOWS = 200_000
"""Preloaded expert windows (paper); fewer with fewer than 4096 environments."""


def window_starts(expert: ExpertFrames, length: int) -> np.ndarray:
    """Frames at which a window of some frames begins and stays within its clip."""
    return np.concatenate([np.arange(a, b - length + 1) for a, b in itertools.pairwise(expert.clip_start)])


def frame_weights(expert: ExpertFrames, starts: np.ndarray) -> np.ndarray:
    """Probability of each start: a clip by its MotionWeight, then its frames uniformly."""
    clip = np.searchsorted(expert.clip_start, starts, side="right") - 1
    count = np.bincount(clip, minlength=len(expert.clip_weight))
    weight = expert.clip_weight[clip] / count[clip]
    return weight / weight.sum()


def command_weights(command: np.ndarray, weight: np.ndarray, config: CommandsConfig, seed: int) -> np.ndarray:
    """Probabilities such that frames' commands are distributed as the policy's.

    Each command of the policy belongs to the nearest cell that has frames; within a cell the weights decide.

    Args:
        command: of each frame (t, 3) [m/s, m/s, rad/s]
        weight: probability of each frame otherwise (t,)
        config: the policy's commands
        seed: of the commands that are drawn to find the share of each cell
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        drawn = draw_commands(CELL_SAMPLES, config, "cpu").numpy()
    cells, member = np.unique(np.round(command / CELL).astype(int), axis=0, return_inverse=True)
    member = member.ravel()
    inside = np.bincount(member, weights=weight, minlength=len(cells))
    distance = ((drawn[:, None] / CELL - cells[None]) ** 2).sum(axis=-1)
    nearest = np.argmin(np.where(inside > 0.0, distance, np.inf), axis=1)
    wanted = np.bincount(nearest, minlength=len(cells)) / len(drawn)
    result = weight / np.maximum(inside, 1e-12)[member] * wanted[member]
    return result / result.sum()


def weights(expert: ExpertFrames, starts: np.ndarray, config: Config, seed: int) -> np.ndarray:
    """Probability of each start under a configuration."""
    weight = frame_weights(expert, starts)
    if config.discriminator.by_command:
        return command_weights(expert.command[starts], weight, config.commands, seed)
    return weight


def expert_windows(expert: ExpertFrames, config: Config, columns: torch.Tensor, seed: int) -> torch.Tensor:
    """Feature windows (n, h, f) of the columns, each of one clip."""
    length = config.discriminator.frames
    starts = window_starts(expert, length)
    count = min(WINDOWS, max(1000, 50 * config.simulation.num_envs))
    drawn = np.random.default_rng(seed).choice(starts, count, p=weights(expert, starts, config, seed))
    known = frame_features(torch.from_numpy(expert.frames))[:, columns]
    return torch.cat(
        [
            known[torch.from_numpy(part[:, None] + np.arange(length))]
            for part in np.array_split(drawn, max(1, len(drawn) // CHUNK))
        ]
    )
