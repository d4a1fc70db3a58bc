"""The Wasserstein discriminator: its network, its loss, its reward, and the replay of policy windows."""

from __future__ import annotations

import torch
from torch import nn

from pipeline.training.motion_features import FeatureNormalizer
from pipeline.training.options import Options


def network(inputs: int, hidden: tuple[int, ...]) -> nn.Sequential:
    """An ELU network with one number out."""
    layers: list[nn.Module] = []
    for size in hidden:
        layers += [nn.Linear(inputs, size), nn.ELU()]
        inputs = size
    return nn.Sequential(*layers, nn.Linear(inputs, 1))


def gradient_penalty(score: nn.Module, expert: torch.Tensor, policy: torch.Tensor, share: torch.Tensor) -> torch.Tensor:
    """E[(|grad D| - 1)^2] at points between expert and policy windows; `share` (n, 1) in 0..1 says where."""
    between = (share * expert + (1.0 - share) * policy).requires_grad_(True)
    (gradient,) = torch.autograd.grad(score(between).sum(), between, create_graph=True)
    return torch.square(torch.linalg.norm(gradient, dim=1) - 1.0).mean()


def style_reward(score: torch.Tensor, alpha: float, beta: float) -> torch.Tensor:
    """alpha (1 + tanh(beta D))."""
    return alpha * (1.0 + torch.tanh(beta * score))


class Replay:
    """A ring of policy windows (m, h, f). Where it is at and how full it is only the GPU knows."""

    def __init__(self, size: int, shape: tuple[int, int], device: str):
        self._size = size
        self._windows = torch.zeros(size + 1, *shape, device=device)  # the last row takes what is not kept
        self._next = torch.zeros((), dtype=torch.long, device=device)
        self._count = torch.zeros((), dtype=torch.long, device=device)

    @property
    def count(self) -> int:
        """How many windows there are. The processor waits for it."""
        return int(self._count)

    def insert(self, windows: torch.Tensor, kept: torch.Tensor) -> None:
        """Put those of the windows (n, h, f) in that are `kept` (n,), over the oldest ones when it is full."""
        windows, kept = windows[-self._size :], kept[-self._size :]
        at = (self._next + kept.cumsum(dim=0) - 1) % self._size
        self._windows[torch.where(kept, at, self._size)] = windows
        self._next.copy_((self._next + kept.sum()) % self._size)
        self._count.copy_((self._count + kept.sum()).clamp(max=self._size))

    def draw(self, count: int) -> torch.Tensor:
        """Windows drawn evenly, with repetition, of a ring that is not empty."""
        share = torch.rand(count, dtype=torch.float64, device=self._windows.device)
        return self._windows[(share * self._count).long()]


class Discriminator:
    """Scores windows; expert ones high, the policy's low."""

    def __init__(self, expert: torch.Tensor, joints: int, options: Options, device: str):
        self._options = options
        self._expert = expert.to(device)
        least = {"joint_vel": options.joint_vel_floor, "ang_vel": options.ang_vel_floor}
        self._normalize = FeatureNormalizer(self._expert.flatten(0, 1), joints, **least)
        self.network = network(expert[0].numel(), options.discriminator_hidden).to(device)
        self.optimizer = torch.optim.Adam(
            self.network.parameters(), lr=options.discriminator_rate, betas=(0.5, 0.9), weight_decay=1e-4
        )
        self.replay = Replay(options.replay_windows, (expert.shape[1], expert.shape[2]), device)
        self.figures: dict[str, float] = {}
        """Means over the last update: D on expert and policy, gradient penalty."""

    @torch.no_grad()
    def score(self, windows: torch.Tensor) -> torch.Tensor:
        """D of windows (n, h, f), (n,)."""
        return self.network(self._normalize(windows))[:, 0]

    def update(self, reduce=None) -> None:
        """Some gradient steps; `reduce(parameters)` averages gradients over processes."""
        options = self._options
        if self.replay.count == 0:
            return
        sums = torch.zeros(3, device=self._expert.device)
        for _ in range(options.discriminator_steps):
            loss, parts = self._loss()
            self.optimizer.zero_grad()
            loss.backward()
            if reduce is not None:
                reduce(self.network.parameters())
            nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
            self.optimizer.step()
            sums += parts
        mean = (sums / options.discriminator_steps).tolist()
        self.figures = dict(zip(("d_expert", "d_policy", "gradient_penalty"), mean, strict=True))

    def _loss(self) -> tuple[torch.Tensor, torch.Tensor]:
        options = self._options
        count = options.discriminator_batch
        drawn = torch.randint(len(self._expert), (count,), device=self._expert.device)
        expert, policy = self._normalize(self._expert[drawn]), self._normalize(self.replay.draw(count))
        d_expert, d_policy = self.network(expert), self.network(policy)
        share = torch.rand(count, 1, device=expert.device)
        penalty = gradient_penalty(self.network, expert, policy, share)
        drift = torch.square(d_expert).mean() + torch.square(d_policy).mean()
        loss = d_policy.mean() - d_expert.mean() + options.gradient_penalty * penalty + options.drift * drift
        return loss, torch.stack([d_expert.mean(), d_policy.mean(), penalty]).detach()
