"""How far hip and knee move in a stride: in the expert's clips by the command that they obey, and of the robots.

Steps can take the clips' time with legs that hardly bend: knees of cheap moved by .53, .61 and .69 rad at .6, 1.0 and
1.5 m/s, in the clips' strides by .89, .94 and 1.18. A robot's stride is seen as its foot is set down, from the last
time that it was, and not through a stand.
"""

from __future__ import annotations

import numpy as np
import torch

from pipeline.learning.training_error import TrainingError
from pipeline.training.bundle import FPS, ExpertFrames
from pipeline.training.command_cells import CommandCells
from pipeline.training.masks import replace
from pipeline.training.reward_terms import told_to_move
from pipeline.training.step_times import LEAST_STEPS, steps

JOINTS = ("Hip_Pitch", "Knee_Pitch")
SIDES = ("Left", "Right")


def swings(expert: ExpertFrames, controlled: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """The frame (k,) at which each step of the clips ends, and how far hip and knee moved (k, 2) [rad] in the stride
    that ends with it, twice the step's time, as the mean of both legs. Strides that began before their clip are left
    out. `controlled` are the joints of the frames. Raises TrainingError where they lack a hip or knee."""
    names = [f"{side}_{joint}" for joint in JOINTS for side in SIDES]
    if missing := [name for name in names if name not in controlled]:
        raise TrainingError(f"the policy does not move {', '.join(missing)}. Train without `full_swing`.")
    joints = expert.frames[:, [7 + controlled.index(name) for name in names]]
    end, took_s = steps(expert)
    begin = end - np.round(2.0 * took_s * FPS).astype(int)
    whole = begin >= expert.clip_start[np.searchsorted(expert.clip_start, end, side="right") - 1]
    found = [np.ptp(joints[a : b + 1], axis=0) for a, b in zip(begin[whole], end[whole], strict=True)]
    return end[whole], np.array(found).reshape(-1, len(JOINTS), len(SIDES)).mean(axis=2)


class ClipSwings:
    """The clips' median movement of hip and knee in a stride for any command: that of the nearest cell that has any."""

    def __init__(self, expert: ExpertFrames, controlled: tuple[str, ...], device: str):
        end, moved = swings(expert, controlled)
        self._cells = CommandCells(expert.command[end], LEAST_STEPS, device)
        median = [np.median(moved[member], axis=0) for member in self._cells.members]
        self._moved = torch.from_numpy(np.array(median)).float().to(device)

    def __call__(self, command: torch.Tensor) -> torch.Tensor:
        """Hip and knee (n, 2) [rad] for commands (n, 3); infinite, which nobody reaches, where no clip strides."""
        if not len(self._moved):
            return torch.full((len(command), len(JOINTS)), torch.inf, device=command.device)
        return self._moved[self._cells.nearest(command)]


class LegSwings:
    """How far hip and knee of N robots have moved since their foot was last set down."""

    def __init__(self, env):
        self._env = env
        names = tuple(f"{side}_{joint}" for side in SIDES for joint in JOINTS)
        self._index = torch.from_numpy(env.context.bundle.robot.index(names)).to(env.device)
        shape = (env.num_envs, len(SIDES), len(JOINTS))
        self._least = torch.full(shape, torch.inf, device=env.device)
        self._most = torch.full(shape, -torch.inf, device=env.device)
        self.moved = torch.zeros(env.num_envs, len(JOINTS), device=env.device)
        """Where a foot has just been set down, how far its leg's hip and knee moved in the stride (n, 2) [rad]; else
        0. The first stride of an episode, or after standing, counts from its start."""

    def advance(self) -> None:
        """A control step further, after the readings and before rewards."""
        joints = self._env.readings.joint_pos[:, self._index].unflatten(1, self._least.shape[1:])
        self.go_on(joints, self._env.readings.landed, told_to_move(self._env.command))

    def go_on(self, joints: torch.Tensor, landed: torch.Tensor, moves: torch.Tensor) -> None:
        """With the angles (n, 2, 2) of hip and knee of the left and right leg, the feet (n, 2) set down now, and who
        is told to move (n,)."""
        torch.minimum(self._least, joints, out=self._least)
        torch.maximum(self._most, joints, out=self._most)
        self.moved.copy_(((self._most - self._least) * landed[..., None]).amax(dim=1))
        anew = (landed | ~moves[:, None])[..., None]
        self._least.copy_(torch.where(anew, joints, self._least))
        self._most.copy_(torch.where(anew, joints, self._most))

    def restart(self, mask: torch.Tensor) -> None:
        """Another episode begins."""
        replace(self._least, mask, torch.inf)
        replace(self._most, mask, -torch.inf)
