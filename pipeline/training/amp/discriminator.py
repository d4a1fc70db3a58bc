"""The discriminator: its network, its two losses, and the style reward.

`wasserstein` (paper): E[D policy] - E[D expert] with a gradient penalty at interpolates (Gulrajani et al. 2017).
`bce`: binary cross-entropy on logits with R1, the squared gradient at expert windows (Mescheder et al. 2018).
With `bce`, updates pause while the mean scores of expert and policy differ by more than `largest_difference`, so that
the discriminator does not outpace the policy. Scores of `wasserstein` have no absolute scale.
"""

import torch
from torch import nn
from torch.nn import functional

from pipeline.training.amp.features import FeatureNormalizer
from pipeline.training.amp.replay import SIZE, Replay
from pipeline.training.config import DiscriminatorConfig

HIDDEN = (512, 256)
BATCH = 4096
"""Expert windows per gradient step, and as many policy windows; fewer with fewer environments."""
ALPHA = 0.25
"""Scale alpha of the style reward (paper)."""
BETA = {"wasserstein": 0.1, "bce": 0.5}
"""Slope beta of the style reward (paper); for logits, 0.5 makes the reward 2 alpha times the expert probability."""
UPDATES = {"wasserstein": 8, "bce": 1}
"""Gradient steps per iteration; `wasserstein`: two per mini-batch of PPO."""
DRIFT = 1e-3
"""Weight of E[D^2], which centres Wasserstein scores at zero."""
FIGURES = ("d_expert", "d_policy", "gradient_penalty", "accuracy")


def network(inputs: int) -> nn.Sequential:
    """An ELU network with one output."""
    layers: list[nn.Module] = []
    for size in HIDDEN:
        layers += [nn.Linear(inputs, size), nn.ELU()]
        inputs = size
    return nn.Sequential(*layers, nn.Linear(inputs, 1))


def gradient_norm(score: nn.Module, windows: torch.Tensor) -> torch.Tensor:
    """|grad D| (n,) at flat windows (n, k), differentiable."""
    inputs = windows.detach().requires_grad_(True)
    (gradient,) = torch.autograd.grad(score(inputs).sum(), inputs, create_graph=True)
    return torch.linalg.norm(gradient, dim=1)


def gradient_penalty(score: nn.Module, expert: torch.Tensor, policy: torch.Tensor, share: torch.Tensor) -> torch.Tensor:
    """E[(|grad D| - 1)^2] at interpolates of expert and policy windows; `share` (n, 1), 0 to 1, is the expert's."""
    return torch.square(gradient_norm(score, share * expert + (1.0 - share) * policy) - 1.0).mean()


def style_reward(score: torch.Tensor, beta: float) -> torch.Tensor:
    """alpha (1 + tanh(beta D))."""
    return ALPHA * (1.0 + torch.tanh(beta * score))


def accuracy(d_expert: torch.Tensor, d_policy: torch.Tensor) -> torch.Tensor:
    """Share of windows classified correctly with the midpoint of both means as threshold."""
    middle = 0.5 * (d_expert.mean() + d_policy.mean())
    return 0.5 * ((d_expert > middle).float().mean() + (d_policy <= middle).float().mean())


class Discriminator:
    """Network, optimizer and replay buffer; expert windows score high, policy windows low."""

    def __init__(
        self, expert: torch.Tensor, min_std: torch.Tensor, config: DiscriminatorConfig, envs: int, device: str
    ):
        self._config = config
        self._expert = expert.to(device)
        self._normalize = FeatureNormalizer(self._expert.flatten(0, 1), min_std)
        self._batch = min(BATCH, max(64, envs))
        self.beta = BETA[config.loss]
        self.network = network(expert[0].numel()).to(device)
        self.optimizer = torch.optim.Adam(
            self.network.parameters(), lr=config.learning_rate, betas=(0.5, 0.9), weight_decay=1e-4
        )
        self.replay = Replay(min(SIZE, max(2000, 122 * envs)), (expert.shape[1], expert.shape[2]), device)
        self.figures: dict[str, float] = {}
        """FIGURES, averaged over the last update."""

    @torch.no_grad()
    def score(self, windows: torch.Tensor) -> torch.Tensor:
        """D (n,) of windows (n, h, f)."""
        return self.network(self._normalize(windows))[:, 0]

    def update(self, reduce=None) -> None:
        """Run the gradient steps of an iteration; `reduce(parameters)` averages gradients over processes."""
        if self.replay.count == 0:
            return
        steps, paused = UPDATES[self._config.loss], self.paused
        sums = torch.zeros(len(FIGURES), device=self._expert.device)
        for _ in range(steps):
            loss, figures = self._loss()
            sums += figures
            if paused:
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
    def paused(self) -> bool:
        """Whether the last mean scores differ by more than `largest_difference`; False before the first update."""
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
