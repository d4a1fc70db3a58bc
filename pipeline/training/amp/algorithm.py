"""PPO of rsl_rl with the adversarial motion prior: the style reward in the blend, the discriminator's updates."""

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
"""Iterations in which a new critic learns alone beside a distilled actor, which its errors would otherwise destroy."""
FIRST_RATE = 1e-5
"""Learning rate that a distilled actor begins with; the divergence then adapts it."""
LARGEST_ROUNDING = 1e-3
"""Error allowed of a sum of 720 products of about 1: in single precision it is 1e-5 to 1e-4, in bfloat16 0.2."""


@contextmanager
def fast_matmul(device: str) -> Iterator[None]:
    """Matrix products of the networks in TF32 on a GPU; on a CPU by oneDNN where that does not round to bfloat16."""
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("high" if device.startswith("cuda") else _cpu_precision())
    try:
        yield
    finally:
        torch.set_float32_matmul_precision(before)


@functools.cache
def _cpu_precision() -> str:
    """`medium` halves the time on a CPU; with AMX it rounds factors to bfloat16, and actions would be 0.002 off."""
    generator = torch.Generator().manual_seed(0)
    one, other = torch.randn(16, 720, generator=generator), torch.randn(720, 512, generator=generator)
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("medium")
    try:
        off = (one @ other - (one.double() @ other.double())).abs().max().item()
    finally:
        torch.set_float32_matmul_precision(before)
    return "medium" if off < LARGEST_ROUNDING else "highest"


class AmpPpo(PPO):
    """rsl_rl's PPO; with style 0 it is that alone."""

    def __init__(
        self,
        *args: Any,
        config: Config,
        expert: torch.Tensor,
        least_std: torch.Tensor,
        warm_up: int,
        **kwargs: Any,
    ):
        """
        Args:
            args: of rsl_rl's PPO
            config: of the run
            expert: feature windows (m, h, f)
            least_std: least standard deviation of each feature (f,)
            warm_up: iterations in which the critic learns alone
            kwargs: of rsl_rl's PPO
        """
        super().__init__(*args, **kwargs)
        self._config, self._warm_up = config, warm_up
        if self.symmetry is not None:
            self.symmetry = MirroredSamples(self.symmetry.env, self.symmetry.data_augmentation_func, True)
        distribution = self._raw_actor.distribution
        if not isinstance(distribution, GaussianDistribution):
            raise TrainingError(f"the actor's distribution is {type(distribution).__name__}, which has no deviation.")
        self._std = distribution.std_param
        self.update_s = 0.0
        """Duration of the last update of the networks [s]."""
        self.explained = float("nan")
        """Share of the variance of the last returns that the critic predicted."""
        envs = config.simulation.num_envs
        style = config.discriminator.style > 0.0
        self.discriminator = (
            Discriminator(expert, least_std, config.discriminator, envs, self.device) if style else None
        )
        self.step_figures = torch.zeros(4, device=self.device)
        """Sums since they were last taken: task reward, style reward, D on the policy, steps."""
        self.iteration = 0
        """Set by the runner."""
        self.run_share = 0.0
        """Share of the run that has passed, set by the runner."""

    def act(self, obs) -> torch.Tensor:
        """Actions of the actor."""
        with fast_matmul(self.device):
            return super().act(obs)

    def process_env_step(self, obs, rewards: torch.Tensor, dones: torch.Tensor, extras: dict) -> None:
        """Blend the style reward in and keep half of the valid windows for the replay; other windows get the mean."""
        style, score = torch.zeros_like(rewards), torch.zeros_like(rewards)
        if self.discriminator is not None:
            motion, valid = extras["motion"], extras["motion_valid"]
            score = mean_where_not(valid, self.discriminator.score(motion))
            style = mean_where_not(valid, style_reward(score, self.discriminator.beta))
            kept = valid & (torch.rand(len(valid), device=valid.device) < 0.5)
            self.discriminator.replay.insert(motion, kept)
        self.step_figures += torch.stack([rewards.mean(), style.mean(), score.mean(), torch.ones_like(score[0])])
        share = self.style_share()
        super().process_env_step(obs, (1.0 - share) * rewards + share * style, dones, extras)

    def style_share(self) -> float:
        """Share of the style reward at this point of the run."""
        return self._config.discriminator.style * ramp(self.run_share, self._config.schedule.style_ramp)

    def final_share(self) -> float:
        """Share of the way to the last values at this point of the run."""
        return ramp(self.run_share, self._config.schedule.final_ramp)

    def largest_deviation(self) -> float:
        """Bound of the actions' deviation at this point of the run."""
        ppo = self._config.ppo
        if ppo.final_std >= 1.0:
            return float("inf")
        return ppo.init_std * (1.0 + (ppo.final_std - 1.0) * self.final_share())

    def update(self) -> dict[str, float]:
        """The discriminator's gradient steps, then PPO's."""
        started, ppo = self._now(), self._config.ppo
        self.desired_kl = ppo.desired_kl + (ppo.final_kl - ppo.desired_kl) * self.final_share()
        with fast_matmul(self.device):
            if self.discriminator is not None:
                self.discriminator.update(self._mean_gradients if self.is_multi_gpu else None)
            self.explained = explained(self.storage.returns, self.storage.values)
            self._warm_critic_up()
            own = self.storage.actions_log_prob
            if self.symmetry is not None:
                mirror: Mirror = cast(Any, self.symmetry.env).mirror
                self.storage.actions_log_prob = torch.cat([own, self._mirrored_log_prob(mirror)], dim=-1)
            figures = super().update()
            self.storage.actions_log_prob = own
        self._std.data.clamp_(max=self.largest_deviation())
        self.update_s = self._now() - started
        return figures

    @torch.no_grad()
    def _mirrored_log_prob(self, mirror: Mirror) -> torch.Tensor:
        """Logarithm of the probability of each mirrored action at its mirrored observation (t, n, 1)."""
        actions = self.storage.actions
        self.actor(mirror.observations(self.storage.observations.flatten(0, 1)), stochastic_output=True)
        return self.actor.get_output_log_prob(mirror.actions(actions.flatten(0, 1))).view(*actions.shape[:2], 1)

    def _warm_critic_up(self) -> None:
        """Freeze the actor until the critic has learned; then start it at a small learning rate, as Adam's first steps
        move every weight by all of it."""
        learns = self.iteration >= self._warm_up
        if self._warm_up and learns and next(self._raw_actor.parameters()) not in self.optimizer.state:
            self.learning_rate = FIRST_RATE
        self._raw_actor.requires_grad_(learns)
        self.schedule = "adaptive" if learns else "fixed"

    def _now(self) -> float:
        if self.device.startswith("cuda"):
            torch.cuda.synchronize()
        return time.monotonic()

    def take_step_figures(self) -> dict[str, float]:
        """Mean task and style reward a step and D on the policy since the last call."""
        task, style, score, steps = self.step_figures.tolist()
        self.step_figures.zero_()
        count = max(steps, 1.0)
        return {"task_reward": task / count, "style_reward": style / count, "d_rollout": score / count}

    def save(self) -> dict:
        """rsl_rl's states and the discriminator's. The replay is not kept: ten iterations fill it again."""
        state = super().save()
        if self.discriminator is not None:
            state["discriminator_state_dict"] = self.discriminator.network.state_dict()
            state["discriminator_optimizer_state_dict"] = self.discriminator.optimizer.state_dict()
        return state

    def load(self, loaded_dict: dict, load_cfg: dict | None, strict: bool) -> bool:
        """Load the states of `save`, in a process that has not stepped yet."""
        result = super().load(loaded_dict, load_cfg, strict)
        if self.discriminator is not None:
            self.discriminator.network.load_state_dict(loaded_dict["discriminator_state_dict"])
            self.discriminator.optimizer.load_state_dict(loaded_dict["discriminator_optimizer_state_dict"])
        return result

    def broadcast_parameters(self) -> None:
        """Give every process the first one's parameters, the discriminator's included."""
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


def mean_where_not(valid: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
    """The values (n,), and the mean of the valid ones where they are not valid (n,); 0 without a valid one."""
    mean = (values * valid).sum() / valid.sum().clamp(min=1)
    return torch.where(valid, values, mean)


def explained(returns: torch.Tensor, values: torch.Tensor) -> float:
    """1 - var(returns - values) / var(returns)."""
    return float(1.0 - (returns - values).var() / returns.var().clamp(min=1e-12))


def ramp(value: float, span: tuple[float, float]) -> float:
    """Share of the way from the first to the last of a span, 0 to 1; a span without length is a step."""
    first, last = span
    if last <= first:
        return float(value >= first)
    return min(1.0, max(0.0, (value - first) / (last - first)))
