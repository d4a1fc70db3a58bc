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
    """A ring of policy windows (m, h, f)."""

    def __init__(self, size: int, shape: tuple[int, int], device: str):
        self._windows = torch.zeros(size, *shape, device=device)
        self._next = 0
        self.count = 0

    def insert(self, windows: torch.Tensor) -> None:
        """Put windows in, over the oldest ones when it is full."""
        windows = windows[-len(self._windows) :]
        at = (self._next + torch.arange(len(windows), device=windows.device)) % len(self._windows)
        self._windows[at] = windows
        self._next = int((self._next + len(windows)) % len(self._windows))
        self.count = min(self.count + len(windows), len(self._windows))

    def draw(self, count: int) -> torch.Tensor:
        """Windows drawn evenly, with repetition."""
        return self._windows[torch.randint(self.count, (count,), device=self._windows.device)]


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
