"""Expert frames as they are drawn: windows for the discriminator, and start states of episodes."""

import itertools

import numpy as np
import torch
from scipy.spatial import cKDTree

from pipeline.training.amp.features import frame_features
from pipeline.training.bundle import ExpertFrames
from pipeline.training.config import CommandsConfig, Config
from pipeline.training.mdp.commands import draw_commands

CELL = np.array([0.15, 0.15, 0.3])
"""Size of a command cell: forward and lateral [m/s], yaw rate [rad/s]."""
OWN, OWN_STARTS = 0.3, 0.5
"""Shares of expert windows and start frames that keep their own command (`drawn_by_command`). An episode lasts about
16 s and a command about 10 s, so half of the start frames give 0.3 of the policy's windows."""
WINDOWS = 200_000
"""Preloaded expert windows (paper), and start frames; fewer with fewer than 4096 environments."""


def window_starts(expert: ExpertFrames, length: int) -> np.ndarray:
    """Frames at which a window of some frames begins and stays within its clip."""
    return np.concatenate([np.arange(a, b - length + 1) for a, b in itertools.pairwise(expert.clip_start)])


def frame_weights(expert: ExpertFrames, starts: np.ndarray) -> np.ndarray:
    """Probability of each start: a clip by its MotionWeight, then its frames uniformly."""
    clip = np.searchsorted(expert.clip_start, starts, side="right") - 1
    count = np.bincount(clip, minlength=len(expert.clip_weight))
    weight = expert.clip_weight[clip] / count[clip]
    return weight / weight.sum()


def drawn_by_command(
    command: np.ndarray, weight: np.ndarray, config: CommandsConfig, seed: int, count: int, own: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Commands as the policy gets them, each with an expert frame, drawn by weight from the nearest cell with frames.

    In a share `own` of them, a moving command is replaced by a frame drawn by its weight alone and that frame's
    velocity; a command to stand stays. So standing stays as frequent, though few clips stand.

    Args:
        command: of each frame (t, 3) [m/s, m/s, rad/s]
        weight: of each frame (t,)
        config: the policy's commands
        seed: of everything random
        count: how many are drawn
        own: share that is kept

    Returns:
        Indices of frames (count,), their commands (count, 3), and whether the command is kept (count,).
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        wanted = draw_commands(count, config, "cpu").numpy()
    known = np.flatnonzero(weight > 0.0)
    cells, member = np.unique(np.round(command[known] / CELL).astype(int), axis=0, return_inverse=True)
    nearest, rng, drawn = cKDTree(cells).query(wanted / CELL)[1], np.random.default_rng(seed), np.zeros(count, int)
    for cell in np.unique(nearest):
        inside, asked = known[member.ravel() == cell], nearest == cell
        drawn[asked] = rng.choice(inside, asked.sum(), p=weight[inside] / weight[inside].sum())
    kept = rng.random(count) < own
    moves = kept & wanted.any(axis=1)
    drawn[moves] = rng.choice(len(weight), moves.sum(), p=weight / weight.sum())
    return drawn, np.where(moves[:, None], command[drawn], wanted).astype(np.float32), kept


def drawn_frames(
    expert: ExpertFrames, starts: np.ndarray, config: Config, seed: int, own: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frames (n,) of the starts, commands that D reads with them (n, 3) or none (n, 0), and kept ones (n, 3) or NaN."""
    count, weight = min(WINDOWS, max(1000, 50 * config.simulation.num_envs)), frame_weights(expert, starts)
    if not config.discriminator.by_command:
        drawn = np.random.default_rng(seed).choice(starts, count, p=weight)
        return drawn, np.zeros((count, 0), np.float32), np.full((count, 3), np.nan, np.float32)
    drawn, command, kept = drawn_by_command(expert.command[starts], weight, config.commands, seed, count, own)
    return starts[drawn], command, np.where(kept[:, None], command, np.float32(np.nan))


def expert_windows(expert: ExpertFrames, config: Config, seed: int) -> torch.Tensor:
    """Windows (n, h, f) of features and, by command, of the command; each is of one clip."""
    length = config.discriminator.frames
    first, command, _ = drawn_frames(expert, window_starts(expert, length), config, seed, OWN)
    known = frame_features(torch.from_numpy(expert.frames))
    motion = known[torch.from_numpy(first[:, None] + np.arange(length))]
    return torch.cat([motion, torch.from_numpy(command)[:, None].expand(-1, length, -1)], dim=2)
