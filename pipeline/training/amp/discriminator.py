"""The discriminator: its network, its two losses, and the style reward.

`wasserstein` (paper): E[D policy] - E[D expert] with a gradient penalty between both (Gulrajani et al. 2017).
`bce`: binary cross-entropy on logits with R1, the squared gradient at expert windows (Mescheder et al. 2018).
With `bce` the discriminator takes no gradient step while its mean scores of expert and policy differ by more than
`largest_difference`, so that it does not run ahead of the policy. Scores of `wasserstein` have no such scale.
"""

import torch
from torch import nn
from torch.nn import functional

from pipeline.training.amp.features import FeatureNormalizer
from pipeline.training.amp.replay import SIZE, Replay
from pipeline.training.config import DiscriminatorConfig

HIDDEN = (512, 256)
BATCH = 4096
"""Expert windows of a gradient step, and as many of the policy; fewer with fewer environments."""
ALPHA = 0.25
"""Of the style reward (paper)."""
BETA = {"wasserstein": 0.1, "bce": 0.5}
"""Of the style reward (paper); with logits 0.5 makes the reward 2 alpha times the probability of being expert."""
UPDATES = {"wasserstein": 8, "bce": 1}
"""Gradient steps an iteration; `wasserstein`: two for each of PPO's mini-batches."""
DRIFT = 1e-3
"""Weight of E[D^2], which fixes the zero of a Wasserstein score."""
FIGURES = ("d_expert", "d_policy", "gradient_penalty", "accuracy")


def network(inputs: int) -> nn.Sequential:
    """An ELU network with one output."""
    layers: list[nn.Module] = []
    for size in HIDDEN:
        layers += [nn.Linear(inputs, size), nn.ELU()]
        inputs = size
    return nn.Sequential(*layers, nn.Linear(inputs, 1))


def gradient_norm(score: nn.Module, windows: torch.Tensor) -> torch.Tensor:
    """|grad D| at flat windows (n, k), differentiable (n,)."""
    at = windows.detach().requires_grad_(True)
    (gradient,) = torch.autograd.grad(score(at).sum(), at, create_graph=True)
    return torch.linalg.norm(gradient, dim=1)


def gradient_penalty(score: nn.Module, expert: torch.Tensor, policy: torch.Tensor, share: torch.Tensor) -> torch.Tensor:
    """E[(|grad D| - 1)^2] at points between expert and policy windows; `share` (n, 1) in 0..1 is the expert's."""
    return torch.square(gradient_norm(score, share * expert + (1.0 - share) * policy) - 1.0).mean()


def style_reward(score: torch.Tensor, beta: float) -> torch.Tensor:
    """alpha (1 + tanh(beta D))."""
    return ALPHA * (1.0 + torch.tanh(beta * score))


def accuracy(d_expert: torch.Tensor, d_policy: torch.Tensor) -> torch.Tensor:
    """Share of windows on the right side of the midpoint between both means."""
    middle = 0.5 * (d_expert.mean() + d_policy.mean())
    return 0.5 * ((d_expert > middle).float().mean() + (d_policy <= middle).float().mean())


class Discriminator:
    """Scores windows; expert ones high, the policy's low."""

    def __init__(
        self, expert: torch.Tensor, least_std: torch.Tensor, config: DiscriminatorConfig, envs: int, device: str
    ):
        self._config = config
        self._expert = expert.to(device)
        self._normalize = FeatureNormalizer(self._expert.flatten(0, 1), least_std)
        self._batch = min(BATCH, max(64, envs))
        self.beta = BETA[config.loss]
        self.network = network(expert[0].numel()).to(device)
        self.optimizer = torch.optim.Adam(
            self.network.parameters(), lr=config.learning_rate, betas=(0.5, 0.9), weight_decay=1e-4
        )
        self.replay = Replay(min(SIZE, max(2000, 122 * envs)), (expert.shape[1], expert.shape[2]), device)
        self.figures: dict[str, float] = {}
        """FIGURES, means over the last update."""

    @torch.no_grad()
    def score(self, windows: torch.Tensor) -> torch.Tensor:
        """D of windows (n, h, f), (n,)."""
        return self.network(self._normalize(windows))[:, 0]

    def update(self, reduce=None) -> None:
        """Gradient steps of an iteration; `reduce(parameters)` averages gradients over processes."""
        if self.replay.count == 0:
            return
        steps, waits = UPDATES[self._config.loss], self.waits
        sums = torch.zeros(len(FIGURES), device=self._expert.device)
        for _ in range(steps):
            loss, figures = self._loss()
            sums += figures
            if waits:
                continue
            self.optimizer.zero_grad()
            loss.backward()
            if reduce is not None:
                reduce(self.network.parameters())
            nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
            self.optimizer.step()
        if reduce is not None:
            torch.distributed.all_reduce(sums)
            sums /= torch.distributed.get_world_size()
        self.figures = dict(zip(FIGURES, (sums / steps).tolist(), strict=True))

    @property
    def waits(self) -> bool:
        """Whether the last update's mean scores differ by more than allowed; not before the first one."""
        difference = self.figures.get("d_expert", 0.0) - self.figures.get("d_policy", 0.0)
        return self._config.loss == "bce" and difference > self._config.largest_difference

    def _loss(self) -> tuple[torch.Tensor, torch.Tensor]:
        count, config = self._batch, self._config
        drawn = torch.randint(len(self._expert), (count,), device=self._expert.device)
        expert, policy = self._normalize(self._expert[drawn]), self._normalize(self.replay.draw(count))
        d_expert, d_policy = self.network(expert), self.network(policy)
        if config.loss == "bce":
            loss = functional.softplus(-d_expert).mean() + functional.softplus(d_policy).mean()
            penalty = torch.square(gradient_norm(self.network, expert)).mean()
        else:
            drift = torch.square(d_expert).mean() + torch.square(d_policy).mean()
            loss = d_policy.mean() - d_expert.mean() + DRIFT * drift
            share = torch.rand(count, 1, device=expert.device)
            penalty = gradient_penalty(self.network, expert, policy, share)
        figures = torch.stack([d_expert.mean(), d_policy.mean(), penalty, accuracy(d_expert, d_policy)]).detach()
        return loss + config.gradient_penalty * penalty, figures
