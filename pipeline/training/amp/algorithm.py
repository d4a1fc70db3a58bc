"""rsl_rl's PPO with the adversarial motion prior: style reward and discriminator updates."""

import functools
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, cast

import torch
from rsl_rl.algorithms import PPO
from rsl_rl.modules.distribution import GaussianDistribution

from pipeline.learning.training_error import TrainingError
from pipeline.training.amp.discriminator import Discriminator, style_reward
from pipeline.training.amp.symmetry import Mirror, MirroredSamples
from pipeline.training.config import Config

CRITIC_WARM_UP = 60
"""Iterations that train only the critic after distillation: errors of a new critic would destroy the actor."""
INITIAL_LEARNING_RATE = 1e-5
"""Learning rate with which a distilled actor starts; the adaptive KL schedule then changes it."""
MAX_ROUNDING_ERROR = 1e-3
"""Allowed error of a sum of 720 products of about 1; single precision gives 1e-5 to 1e-4, bfloat16 0.2."""


@contextmanager
def fast_matmul(device: str) -> Iterator[None]:
    """Set the matmul precision: TF32 on a GPU; on a CPU, `medium` unless that rounds to bfloat16."""
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("high" if device.startswith("cuda") else _cpu_precision())
    try:
        yield
    finally:
        torch.set_float32_matmul_precision(before)


@functools.cache
def _cpu_precision() -> str:
    """`medium` halves the time on a CPU; with AMX it rounds to bfloat16, which gives action errors of 0.002."""
    generator = torch.Generator().manual_seed(0)
    a, b = torch.randn(16, 720, generator=generator), torch.randn(720, 512, generator=generator)
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("medium")
    try:
        error = (a @ b - (a.double() @ b.double())).abs().max().item()
    finally:
        torch.set_float32_matmul_precision(before)
    return "medium" if error < MAX_ROUNDING_ERROR else "highest"


class AmpPpo(PPO):
    """rsl_rl's PPO with a discriminator; with style 0, plain PPO."""

    def __init__(
        self,
        *args: Any,
        config: Config,
        expert: torch.Tensor,
        min_std: torch.Tensor,
        warm_up: int,
        **kwargs: Any,
    ):
        """
        Args:
            args: arguments of rsl_rl's PPO
            config: configuration of the run
            expert: expert feature windows (m, h, f)
            min_std: lower bound of each feature's standard deviation (f,)
            warm_up: iterations that train only the critic
            kwargs: arguments of rsl_rl's PPO
        """
        super().__init__(*args, **kwargs)
        self._config, self._warm_up = config, warm_up
        if self.symmetry is not None:
            self.symmetry = MirroredSamples(self.symmetry.env, self.symmetry.data_augmentation_func, True)
        distribution = self._raw_actor.distribution
        if not isinstance(distribution, GaussianDistribution):
            raise TrainingError(
                f"the actor's distribution is {type(distribution).__name__}, but AMP needs GaussianDistribution."
            )
        self._std = distribution.std_param
        self.update_s = 0.0
        """Duration of the last network update [s]."""
        self.explained_variance = float("nan")
        """Explained variance of the last returns."""
        envs = config.simulation.num_envs
        style = config.discriminator.style > 0.0
        self.discriminator = Discriminator(expert, min_std, config.discriminator, envs, self.device) if style else None
        self.step_figures = torch.zeros(4, device=self.device)
        """Sums since `take_step_figures`: task reward, style reward, D of policy windows, steps."""
        self.iteration = 0
        """Set by the runner."""
        self.progress = 0.0
        """Finished share of the run, 0 to 1, set by the runner."""

    def act(self, obs) -> torch.Tensor:
        """Sample actions of the actor."""
        with fast_matmul(self.device):
            return super().act(obs)

    def process_env_step(self, obs, rewards: torch.Tensor, dones: torch.Tensor, extras: dict) -> None:
        """Blend in the style reward (mean for invalid windows); add half of the valid windows to the replay buffer."""
        style, score = torch.zeros_like(rewards), torch.zeros_like(rewards)
        if self.discriminator is not None:
            motion, valid = extras["motion"], extras["motion_valid"]
            score = fill_invalid_with_mean(valid, self.discriminator.score(motion))
            style = fill_invalid_with_mean(valid, style_reward(score, self.discriminator.beta))
            kept = valid & (torch.rand(len(valid), device=valid.device) < 0.5)
            self.discriminator.replay.insert(motion, kept)
        self.step_figures += torch.stack([rewards.mean(), style.mean(), score.mean(), torch.ones_like(score[0])])
        share = self.style_share()
        super().process_env_step(obs, (1.0 - share) * rewards + share * style, dones, extras)

    def style_share(self) -> float:
        """Current share of the style reward in the total."""
        return self._config.discriminator.style * ramp(self.progress, self._config.schedule.style_ramp)

    def final_share(self) -> float:
        """Current value of the final ramp, 0 to 1."""
        return ramp(self.progress, self._config.schedule.final_ramp)

    def max_action_std(self) -> float:
        """Current upper bound of the action std."""
        ppo = self._config.ppo
        if ppo.final_std >= 1.0:
            return float("inf")
        return ppo.init_std * (1.0 + (ppo.final_std - 1.0) * self.final_share())

    def update(self) -> dict[str, float]:
        """Update the discriminator, then actor and critic."""
        started, ppo = self._now(), self._config.ppo
        self.desired_kl = ppo.desired_kl + (ppo.final_kl - ppo.desired_kl) * self.final_share()
        with fast_matmul(self.device):
            if self.discriminator is not None:
                self.discriminator.update(self._mean_gradients if self.is_multi_gpu else None)
            self.explained_variance = explained_variance(self.storage.returns, self.storage.values)
            self._warm_critic_up()
            own = self.storage.actions_log_prob
            if self.symmetry is not None:
                mirror: Mirror = cast(Any, self.symmetry.env).mirror
                self.storage.actions_log_prob = torch.cat([own, self._mirrored_log_prob(mirror)], dim=-1)
            figures = super().update()
            self.storage.actions_log_prob = own
        self._std.data.clamp_(max=self.max_action_std())
        self.update_s = self._now() - started
        return figures

    @torch.no_grad()
    def _mirrored_log_prob(self, mirror: Mirror) -> torch.Tensor:
        """Log probability of each mirrored action at its mirrored observation (t, n, 1)."""
        actions = self.storage.actions
        self.actor(mirror.observations(self.storage.observations.flatten(0, 1)), stochastic_output=True)
        return self.actor.get_output_log_prob(mirror.actions(actions.flatten(0, 1))).view(*actions.shape[:2], 1)

    def _warm_critic_up(self) -> None:
        """Freeze the actor during the critic's warm-up; then start it at a small learning rate: Adam's first steps move
        every weight by the full rate."""
        learns = self.iteration >= self._warm_up
        if self._warm_up and learns and next(self._raw_actor.parameters()) not in self.optimizer.state:
            self.learning_rate = INITIAL_LEARNING_RATE
        self._raw_actor.requires_grad_(learns)
        self.schedule = "adaptive" if learns else "fixed"

    def _now(self) -> float:
        if self.device.startswith("cuda"):
            torch.cuda.synchronize()
        return time.monotonic()

    def take_step_figures(self) -> dict[str, float]:
        """Mean task reward, style reward and D of policy windows per step since the last call."""
        task, style, score, steps = self.step_figures.tolist()
        self.step_figures.zero_()
        count = max(steps, 1.0)
        return {"task_reward": task / count, "style_reward": style / count, "d_rollout": score / count}

    def save(self) -> dict:
        """State of rsl_rl and of the discriminator. The replay buffer is not saved: ten iterations refill it."""
        state = super().save()
        if self.discriminator is not None:
            state["discriminator_state_dict"] = self.discriminator.network.state_dict()
            state["discriminator_optimizer_state_dict"] = self.discriminator.optimizer.state_dict()
        return state

    def load(self, loaded_dict: dict, load_cfg: dict | None, strict: bool) -> bool:
        """Load a state from `save`, before the first step of this process."""
        result = super().load(loaded_dict, load_cfg, strict)
        if self.discriminator is not None:
            self.discriminator.network.load_state_dict(loaded_dict["discriminator_state_dict"])
            self.discriminator.optimizer.load_state_dict(loaded_dict["discriminator_optimizer_state_dict"])
        return result

    def broadcast_parameters(self) -> None:
        """Broadcast the parameters of rank 0, including the discriminator's."""
        super().broadcast_parameters()
        if self.discriminator is not None:
            states = [self.discriminator.network.state_dict()]
            torch.distributed.broadcast_object_list(states, src=0)
            self.discriminator.network.load_state_dict(states[0])

    def _mean_gradients(self, parameters: Iterable[torch.nn.Parameter]) -> None:
        for parameter in parameters:
            if parameter.grad is not None:
                torch.distributed.all_reduce(parameter.grad)
                parameter.grad /= self.gpu_world_size


def fill_invalid_with_mean(valid: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
    """Replace invalid values (n,) with the mean of the valid ones, or with 0 if none is valid."""
    mean = (values * valid).sum() / valid.sum().clamp(min=1)
    return torch.where(valid, values, mean)


def explained_variance(returns: torch.Tensor, values: torch.Tensor) -> float:
    """1 - var(returns - values) / var(returns)."""
    return float(1.0 - (returns - values).var() / returns.var().clamp(min=1e-12))


def ramp(value: float, span: tuple[float, float]) -> float:
    """Linear ramp from 0 to 1 over `span`; an empty span is a step."""
    first, last = span
    if last <= first:
        return float(value >= first)
    return min(1.0, max(0.0, (value - first) / (last - first)))
