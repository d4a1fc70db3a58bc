"""Sampling of expert frames: windows for the discriminator, and start frames of episodes."""

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
KEPT_SHARE, KEPT_STARTS_SHARE = 0.3, 0.5
"""Shares of expert windows and start frames that keep the frame's command (`sample_by_command`). Episodes last about
16 s and commands about 10 s, so half of the start frames give 0.3 of the policy's windows."""
WINDOWS = 200_000
"""Preloaded expert windows (paper) and start frames; fewer with fewer than 4096 environments."""


def window_starts(expert: ExpertFrames, length: int) -> np.ndarray:
    """Indices of frames at which a window of `length` frames begins and stays within its clip."""
    return np.concatenate([np.arange(a, b - length + 1) for a, b in itertools.pairwise(expert.clip_start)])


def frame_weights(expert: ExpertFrames, starts: np.ndarray) -> np.ndarray:
    """Probability of each start: clips by MotionWeight, then frames uniformly."""
    clip = np.searchsorted(expert.clip_start, starts, side="right") - 1
    count = np.bincount(clip, minlength=len(expert.clip_weight))
    weight = expert.clip_weight[clip] / count[clip]
    return weight / weight.sum()


def sample_by_command(
    command: np.ndarray, weight: np.ndarray, config: CommandsConfig, seed: int, count: int, kept_share: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sample policy commands, each with an expert frame drawn by weight from the nearest non-empty command cell.

    For a share `kept_share`, a moving command is replaced by the velocity of a frame drawn by weight alone; standing
    commands remain, so that standing keeps its frequency although few clips stand.

    Args:
        command: velocity of each frame (t, 3) [m/s, m/s, rad/s]
        weight: weight of each frame (t,)
        config: distribution of the policy's commands
        seed: random seed
        count: number of samples
        kept_share: share of samples that keep the frame's command

    Returns:
        Frame indices (count,), commands (count, 3), and whether an episode there keeps its command (count,).
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        sampled = draw_commands(count, config, "cpu").numpy()
    weighted = np.flatnonzero(weight > 0.0)
    cells, member = np.unique(np.round(command[weighted] / CELL).astype(int), axis=0, return_inverse=True)
    nearest, rng, drawn = cKDTree(cells).query(sampled / CELL)[1], np.random.default_rng(seed), np.zeros(count, int)
    for cell in np.unique(nearest):
        inside, rows = weighted[member.ravel() == cell], nearest == cell
        drawn[rows] = rng.choice(inside, rows.sum(), p=weight[inside] / weight[inside].sum())
    kept = rng.random(count) < kept_share
    moving = kept & sampled.any(axis=1)
    drawn[moving] = rng.choice(len(weight), moving.sum(), p=weight / weight.sum())
    return drawn, np.where(moving[:, None], command[drawn], sampled).astype(np.float32), kept


def sample_frames(
    expert: ExpertFrames, starts: np.ndarray, config: Config, seed: int, kept_share: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sample start frames (n,), commands that D observes (n, 3) or (n, 0), and commands to keep (n, 3), else NaN."""
    count, weight = min(WINDOWS, max(1000, 50 * config.simulation.num_envs)), frame_weights(expert, starts)
    if not config.discriminator.by_command:
        drawn = np.random.default_rng(seed).choice(starts, count, p=weight)
        return drawn, np.zeros((count, 0), np.float32), np.full((count, 3), np.nan, np.float32)
    drawn, command, kept = sample_by_command(expert.command[starts], weight, config.commands, seed, count, kept_share)
    return starts[drawn], command, np.where(kept[:, None], command, np.float32(np.nan))


def expert_windows(expert: ExpertFrames, config: Config, seed: int) -> torch.Tensor:
    """Expert windows (n, h, f) of features and, with `by_command`, the command; each within one clip."""
    length = config.discriminator.frames
    first, command, _ = sample_frames(expert, window_starts(expert, length), config, seed, KEPT_SHARE)
    features = frame_features(torch.from_numpy(expert.frames))
    motion = features[torch.from_numpy(first[:, None] + np.arange(length))]
    return torch.cat([motion, torch.from_numpy(command)[:, None].expand(-1, length, -1)], dim=2)
