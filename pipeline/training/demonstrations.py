"""Expert frames as what a policy would have seen and answered there, to be imitated.

Observations are those of `observations.py`; answers are the targets of the bundle as actions. States are drawn off the
clips' own, answers are not, so that a joint that is elsewhere is led back; and past actions are drawn far off, so that
the network reads its phase from the joints rather than going on with what it last said. Targets were made without
simulation: a network that only imitates them walks a step or two in the clips' gait and falls.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable

import numpy as np
import torch
from rsl_rl.models import MLPModel
from tensordict import TensorDict
from torch import nn

from pipeline.training.action import SCALE
from pipeline.training.bundle import Bundle
from pipeline.training.expert_sampling import cell_weights
from pipeline.training.observations import HISTORY, frame
from pipeline.training.options import Options

OFF = {"gyro": 0.2, "gravity": 0.04, "joints": 0.04, "speeds": 0.3}
"""Deviations of a whole history from the clip's [rad/s, 1, rad, rad/s] …"""
SHAKE = {"gyro": 0.1, "gravity": 0.02, "joints": 0.005, "speeds": 0.3, "actions": 0.4}
"""… and of each frame of it."""
YOUNG = 0.25
"""Share of histories that have just begun, as those of an episode's first HISTORY steps."""
LARGEST_ACTION = 12.0
"""3 rad: targets beyond it are of frames that no force explains."""
CLONING_RATE, CLONING_ROWS, NORMALIZER_ROWS = 1e-3, 4096, 65536


class Demonstrations:
    """Observations and actions of expert frames, drawn so that their commands are distributed as the policy's."""

    def __init__(self, bundle: Bundle, options: Options, seed: int, device: str):
        expert, robot = bundle.expert, bundle.robot
        starts = np.concatenate(
            [np.arange(a + HISTORY - 1, b - 1) for a, b in itertools.pairwise(expert.clip_start) if b - a > HISTORY]
        )
        weight = cell_weights(expert, starts, options, seed)
        self._starts = torch.from_numpy(starts).to(device)
        self._weight = torch.from_numpy(np.cumsum(weight)).float().to(device)
        frames, actions = _frames(bundle)
        self._frames, self._actions = frames.to(device), actions.to(device)
        joints = len(robot.policy_joints)
        self._off = _scales(OFF, joints).to(device)
        self._shake = _scales(SHAKE, joints).to(device)
        self._random = torch.Generator(device).manual_seed(seed)

    def draw(self, count: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Observations (count, 10 f) of the actor, with noise, and the actions (count, a) that answer them."""
        device = self._frames.device
        at = torch.searchsorted(self._weight, self._uniform(count)).clamp(max=len(self._starts) - 1)
        newest = self._starts[at]
        history = self._frames[newest[:, None] + torch.arange(1 - HISTORY, 1, device=device)]
        history = history + self._off * self._normal(count, 1) + self._shake * self._normal(count, HISTORY)
        young = self._uniform(count) < YOUNG
        age = torch.where(young, (HISTORY * self._uniform(count)).long(), HISTORY)[:, None]
        step = torch.arange(HISTORY, device=device) - (HISTORY - 1) + age
        history = torch.where((step < 0)[..., None], 0.0, history)
        actions = history[..., 9 + 2 * self._actions.shape[1] :]
        actions[step == 0] = 0.0
        return history.flatten(1), self._actions[newest]

    def error(self, actor: nn.Module, count: int) -> torch.Tensor:
        """Mean square of what an actor answers beside what it should."""
        observations, actions = self.draw(count)
        return ((actor(_group(observations)) - actions) ** 2).mean()

    def _uniform(self, count: int) -> torch.Tensor:
        return torch.rand(count, generator=self._random, device=self._frames.device)

    def _normal(self, count: int, frames: int) -> torch.Tensor:
        size = (count, frames, self._frames.shape[1])
        return torch.randn(size, generator=self._random, device=self._frames.device)


def _frames(bundle: Bundle) -> tuple[torch.Tensor, torch.Tensor]:
    """Frames (t, f) of observations without noise and actions (t, a), in the policy's order of joints."""
    expert, robot = bundle.expert, bundle.robot
    joints = expert.controlled
    order = [robot.controlled.index(name) for name in robot.policy_joints]
    default = robot.default_joint_pos[robot.index(robot.policy_joints)]
    after = 7 + joints + 12
    positions = expert.frames[:, 7 : 7 + joints][:, order] - default
    speeds = expert.frames[:, after + 6 : after + 6 + joints][:, order]
    actions = np.clip((expert.target[:, order] - default) / SCALE, -LARGEST_ACTION, LARGEST_ACTION)
    last = np.concatenate([actions[:1], actions[:-1]])
    last[expert.clip_start[:-1]] = actions[expert.clip_start[:-1]]
    parts = (
        expert.frames[:, after + 3 : after + 6],
        _gravity_b(expert.frames[:, 3:7]),
        expert.command,
        positions,
        speeds,
        last,
    )
    tensors = [torch.from_numpy(np.ascontiguousarray(part, dtype=np.float32)) for part in parts]
    return frame(*tensors), torch.from_numpy(actions.astype(np.float32))


def _gravity_b(quat: np.ndarray) -> np.ndarray:
    """Down (t, 3) in the root's frame."""
    w, x, y, z = quat.T
    return -np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)], axis=1)


def _scales(of: dict[str, float], joints: int) -> torch.Tensor:
    sizes = {"gyro": 3, "gravity": 3, "command": 3, "joints": joints, "speeds": joints, "actions": joints}
    return torch.cat([torch.full((size,), of.get(name, 0.0)) for name, size in sizes.items()])


def _group(observations: torch.Tensor) -> TensorDict:
    return TensorDict({"actor": observations}, batch_size=len(observations))


def clone(actor: MLPModel, demonstrations: Demonstrations, steps: int) -> float:
    """Imitate for some gradient steps, the normalizer first; the error that is left."""
    actor.train()
    actor.update_normalization(_group(demonstrations.draw(NORMALIZER_ROWS)[0]))
    optimizer = torch.optim.Adam(actor.mlp.parameters(), CLONING_RATE)
    error = torch.zeros(())
    for step in range(steps):
        optimizer.param_groups[0]["lr"] = CLONING_RATE * (1.0 - step / steps)
        optimizer.zero_grad()
        error = demonstrations.error(actor, CLONING_ROWS)
        error.backward()
        optimizer.step()
    return float(error.detach())


def add_gradients(
    parameters: Iterable[nn.Parameter],
    error: torch.Tensor,
    weight: float,
    mean: Callable[[Iterable[torch.Tensor]], None] | None,
) -> None:
    """Add those of `weight` times the error to the parameters'; `mean` makes them those of all processes."""
    held = [parameter for parameter in parameters if parameter.requires_grad]
    found = torch.autograd.grad(weight * error, held, allow_unused=True)
    gradients = [each for each in found if each is not None]
    if mean is not None:
        mean(gradients)
    for parameter, gradient in zip(held, found, strict=True):
        if gradient is not None:
            parameter.grad = gradient if parameter.grad is None else parameter.grad + gradient
