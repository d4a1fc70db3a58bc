"""mjlab's `MotionCommand` for many clips: episodes do not cross clip boundaries; bins with failures are sampled
more."""

import itertools
from dataclasses import dataclass
from typing import cast

import torch
from mjlab.envs import ManagerBasedRlEnv
from mjlab.managers.action_manager import ActionTerm, ActionTermCfg
from mjlab.tasks.tracking.mdp import MotionCommand, MotionCommandCfg

from pipeline.tracking.task import ACTION_SCALE, DECIMATION

BIN_FRAMES = 50
"""Frames of a sampling bin: one second, as in mjlab."""

SHORTEST_EPISODE = 2
"""Least number of frames from the start of an episode to the end of its clip."""


@dataclass(kw_only=True)
class ClipsCommandCfg(MotionCommandCfg):
    """`MotionCommandCfg` for a motion file with several clips."""

    clip_start: tuple[int, ...]
    """Index of each clip's first frame, and the total frame count (c + 1,)."""
    uniform_share: float = 0.5
    """Share of episodes that start at a uniformly sampled frame; the others start where episodes failed."""

    def build(self, env: ManagerBasedRlEnv) -> "ClipsCommand":
        return ClipsCommand(self, env)


class ClipsCommand(MotionCommand):
    """Reference motion of each environment: its clip, and the frame to reach at the end of the control step."""

    cfg: ClipsCommandCfg

    def __init__(self, cfg: ClipsCommandCfg, env: ManagerBasedRlEnv):
        super().__init__(cfg, env)
        start = torch.tensor(cfg.clip_start, device=self.device)
        lengths = start[1:] - start[:-1]
        self.last_frame = torch.repeat_interleave(start[1:] - 1, lengths)
        """Index of the last frame of the clip that a frame belongs to (t,)."""
        first, size = _bins(cfg.clip_start)
        self._bin_first, self._bin_size = (torch.tensor(values, device=self.device) for values in (first, size))
        self._frame_bin = torch.bucketize(
            torch.arange(self.motion.time_step_total, device=self.device), self._bin_first, right=True
        )
        self._frame_bin -= 1
        self.bin_count = len(first)
        self.bin_failed_count = torch.zeros(self.bin_count, device=self.device)
        self._current_bin_failed = torch.zeros(self.bin_count, device=self.device)

    def _adaptive_sampling(self, env_ids: torch.Tensor) -> None:
        failed = self._env.termination_manager.terminated[env_ids]
        bins = self._frame_bin[self.time_steps[env_ids][failed]]
        self._current_bin_failed += torch.bincount(bins, minlength=self.bin_count)
        uniform = self._bin_size / self._bin_size.sum()
        hard = self.bin_failed_count / self.bin_failed_count.sum().clamp(min=1e-9)
        known = (self.bin_failed_count.sum() > 1e-6).float()
        share = 1.0 - known * (1.0 - self.cfg.uniform_share)
        probability = share * uniform + (1.0 - share) * hard
        drawn = torch.multinomial(probability, len(env_ids), replacement=True)
        offset = torch.rand(len(env_ids), device=self.device) * self._bin_size[drawn]
        self.time_steps[env_ids] = self._bin_first[drawn] + offset.long().clamp(max=self._bin_size[drawn] - 1)
        self.metrics["sampling_top1_prob"][:] = probability.max()

    def _update_command(self, env_ids: torch.Tensor | None = None) -> None:
        super()._update_command(env_ids)
        self.time_steps.clamp_(max=self.motion.time_step_total - 1)


def _bins(clip_start: tuple[int, ...]) -> tuple[list[int], list[int]]:
    """First frame and number of possible start frames of each bin; the last frames of a clip are no start frames."""
    first, size = [], []
    for start, stop in itertools.pairwise(clip_start):
        frames = max(stop - start - SHORTEST_EPISODE, 1)
        count = max(round(frames / BIN_FRAMES), 1)
        edges = [start + frames * index // count for index in range(count + 1)]
        first += edges[:-1]
        size += [high - low for low, high in itertools.pairwise(edges)]
    return first, size


def clip_ended(env: ManagerBasedRlEnv, command_name: str) -> torch.Tensor:
    """Termination: the last frame of the clip was reached. A time-out, not a failure (n,)."""
    command = cast(ClipsCommand, env.command_manager.get_term(command_name))
    return command.time_steps >= command.last_frame[command.time_steps]


@dataclass(kw_only=True)
class ReferenceResidualCfg(ActionTermCfg):
    """Configuration of `ReferenceResidual`."""

    joint_names: tuple[str, ...]
    """Joints that the action moves; the others follow the reference."""
    command_name: str = "motion"
    largest_lag: int = 2
    """Largest delay of targets [physics steps], sampled from 0 per episode."""

    def build(self, env: ManagerBasedRlEnv) -> "ReferenceResidual":
        return ReferenceResidual(self, env)


class ReferenceResidual(ActionTerm):
    """Joint targets: the reference's joint positions plus the scaled action."""

    cfg: ReferenceResidualCfg

    def __init__(self, cfg: ReferenceResidualCfg, env: ManagerBasedRlEnv):
        super().__init__(cfg, env)
        names = list(self._entity.joint_names)
        self._index = torch.tensor([names.index(name) for name in cfg.joint_names], device=self.device)
        self._raw = torch.zeros(self.num_envs, len(self._index), device=self.device)
        self._target = torch.zeros(self.num_envs, len(names), device=self.device)
        self._before = torch.zeros_like(self._target)
        self._lag = torch.zeros(self.num_envs, 1, dtype=torch.long, device=self.device)
        self._substep = 0

    @property
    def action_dim(self) -> int:
        return len(self._index)

    @property
    def raw_action(self) -> torch.Tensor:
        return self._raw

    def process_actions(self, actions: torch.Tensor) -> None:
        command = cast(MotionCommand, self._env.command_manager.get_term(self.cfg.command_name))
        self._raw[:] = actions
        self._before.copy_(self._target)
        self._target.copy_(command.joint_pos)
        self._target[:, self._index] += ACTION_SCALE * actions
        fresh = self._env.episode_length_buf == 0
        self._before[fresh] = self._target[fresh]
        self._substep = 0

    def apply_actions(self) -> None:
        """Apply, at each physics step, the new target, or the previous one during the delay."""
        target = torch.where(self._lag > self._substep % DECIMATION, self._before, self._target)
        self._entity.set_joint_position_target(target)
        self._substep += 1

    def reset(self, env_ids: torch.Tensor | slice | None = None) -> None:
        if env_ids is None:
            env_ids = slice(None)
        self._raw[env_ids] = 0.0
        count = len(self._lag[env_ids])
        self._lag[env_ids] = torch.randint(self.cfg.largest_lag + 1, (count, 1), device=self.device)
