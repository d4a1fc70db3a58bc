"""PPO of rsl-rl with the adversarial motion prior: the style reward in the blend, the discriminator's updates."""

from __future__ import annotations

import functools
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import torch
from rsl_rl.algorithms import PPO
from rsl_rl.modules.distribution import GaussianDistribution

from pipeline.learning.training_error import TrainingError
from pipeline.training.discriminator import Discriminator, style_reward
from pipeline.training.kept_walk import KeptWalk
from pipeline.training.mirror import MirroredSamples
from pipeline.training.options import Options

FIRST_RATE = 1e-5
"""Learning rate that a network which was given begins with; the divergence soon says by how much it may grow."""
MOST_ROUNDED = 1e-3
"""By how much a sum of 720 products of about 1 may be off: in single precision it is 1e-5 to 1e-4, with factors of
bfloat16 .2."""


@contextmanager
def quick_products(device: str) -> Iterator[None]:
    """Matrix products of the networks in TF32 on a GPU that has it; those of the environment are not. On a processor by
    oneDNN, which takes half the time there, where that does not round."""
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("high" if device.startswith("cuda") else _precision_of_processor())
    try:
        yield
    finally:
        torch.set_float32_matmul_precision(before)


@functools.cache
def _precision_of_processor() -> str:
    """`medium` lets oneDNN round factors to bfloat16. With AVX-512 alone it does not; with AMX it does, and actions are
    .002 off: there products are whole ones."""
    generator = torch.Generator().manual_seed(0)
    one, other = torch.randn(16, 720, generator=generator), torch.randn(720, 512, generator=generator)
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("medium")
    try:
        off = (one @ other - (one.double() @ other.double())).abs().max().item()
    finally:
        torch.set_float32_matmul_precision(before)
    return "medium" if off < MOST_ROUNDED else "highest"


class AmpPpo(PPO):
    """rsl-rl's PPO; with `options.style` at 0 it is that alone."""

    def __init__(self, *args: Any, options: Options, expert: torch.Tensor, joints: int, **kwargs: Any):
        super().__init__(*args, **kwargs)
        self._options = options
        if self.symmetry is not None:
            self.symmetry = MirroredSamples(self.symmetry.env, self.symmetry.data_augmentation_func, True)
        distribution = self._raw_actor.distribution
        if not isinstance(distribution, GaussianDistribution):
            raise TrainingError(
                f"the actor draws from {type(distribution).__name__}; its deviation has no bound to sink."
            )
        self._std = distribution.std_param
        if options.critic_rate:
            self.optimizer = self._two_rates(options.critic_rate)
        self.update_s = 0.0
        """Duration of the last update of the networks [s]."""
        self.explained = float("nan")
        """Share of the variance of the last returns that the critic had foreseen."""
        self.kept = 0.0
        """Mean of the loss of the walk that is kept, at the last update."""
        self.discriminator = Discriminator(expert, joints, options, self.device) if options.style > 0.0 else None
        self.step_figures = torch.zeros(4, device=self.device)
        """Sums since they were last taken: task reward, style reward, D on the policy, steps."""
        self.iteration = 0.0
        """Set by the run: how far its schedules are."""
        self.followed = 0.0
        """Set by the run: the share of the commands that is reached."""
        self._synchronized = False

    def keep_walk(self) -> None:
        """Stay near what the actor does now as it is told ahead."""
        assert isinstance(self.symmetry, MirroredSamples), "options with keep have symmetry"
        self.symmetry.keep(KeptWalk(self._raw_actor, self._options.init_std, self._options.keep, self._options.keep_of))

    def _two_rates(self, critic_rate: float) -> torch.optim.Optimizer:
        """rsl-rl's optimizer with the critic in a group of its own: what it says of the rate is the actor's."""
        networks = (self._raw_actor, self._raw_critic)
        optimizer = torch.optim.Adam([{"params": list(each.parameters())} for each in networks], lr=self.learning_rate)

        def own_rate(*_: Any) -> None:
            optimizer.param_groups[1]["lr"] = critic_rate

        optimizer.register_step_pre_hook(own_rate)
        return optimizer

    def act(self, obs) -> torch.Tensor:
        """Actions of the networks."""
        with quick_products(self.device):
            return super().act(obs)

    def process_env_step(self, obs, rewards: torch.Tensor, dones: torch.Tensor, extras: dict) -> None:
        """Blend the style reward in; windows of one episode are scored and half of them kept."""
        style, score = torch.zeros_like(rewards), torch.zeros_like(rewards)
        if self.discriminator is not None:
            motion, valid = extras["motion"], extras["motion_valid"]
            score = self.discriminator.score(motion)
            style = style_reward(score, self._options.alpha, self._options.beta) * valid
            kept = valid & (torch.rand(len(valid), device=valid.device) < 0.5)
            self.discriminator.replay.insert(motion, kept)
        self.step_figures += torch.stack([rewards.mean(), style.mean(), score.mean(), torch.ones_like(score[0])])
        share = self.style_share()
        super().process_env_step(obs, (1.0 - share) * rewards + share * style, dones, extras)

    def style_share(self) -> float:
        """Share of the style reward at this iteration, held back where the commands are not followed."""
        options = self._options
        return (
            options.style * _grown(self.iteration, options.style_iterations) * _grown(self.followed, options.style_gate)
        )

    def held_kl(self) -> float:
        """The divergence that the learning rate is held to at this iteration."""
        options = self._options
        if not options.final_kl:
            return options.desired_kl
        share = _grown(self.iteration, options.final_iterations)
        return options.desired_kl + (options.final_kl - options.desired_kl) * share

    def update(self) -> dict[str, float]:
        """The discriminator's gradient steps, then PPO's; exploration is held below its bound."""
        begun = self._now()
        self.desired_kl = self.held_kl()
        with quick_products(self.device):
            if self.discriminator is not None:
                self.discriminator.update(self._mean_gradients if self.is_multi_gpu else None)
            self.explained = explained(self.storage.returns, self.storage.values)
            self._let_actor_learn()
            figures = super().update()
        self.kept = figures.get("symmetry", 0.0)
        self._std.data.clamp_(max=self.largest_deviation())
        self.update_s = self._now() - begun
        return figures

    def _let_actor_learn(self) -> None:
        """After the critic has learnt alone, at a small rate: Adam's first steps move every weight by all of it.

        Until then the rate stays: the divergence that it is held to is that of the normalizer alone.
        """
        first = self._options.critic_iterations
        learns = self.iteration >= first
        if first and learns and next(self._raw_actor.parameters()) not in self.optimizer.state:  # a checkpoint has it
            self.learning_rate = FIRST_RATE
        self._raw_actor.requires_grad_(learns)
        self.schedule = "adaptive" if learns else "fixed"

    def largest_deviation(self) -> float:
        """Of the actions at this iteration."""
        options = self._options
        if not options.std_end:
            return float("inf")
        return options.init_std * (1.0 + (options.std_end - 1.0) * _grown(self.iteration, options.std_iterations))

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
        """rsl-rl's states and the discriminator's. The replay is not kept: two iterations fill it anew."""
        state = super().save()
        state["followed"] = self.followed
        if self.discriminator is not None:
            state["discriminator_state_dict"] = self.discriminator.network.state_dict()
            state["discriminator_optimizer_state_dict"] = self.discriminator.optimizer.state_dict()
        return state

    def load(self, loaded_dict: dict, load_cfg: dict | None, strict: bool) -> bool:
        """Take up the states of `save`; only in a process that has not stepped yet."""
        result = super().load(loaded_dict, load_cfg, strict)
        self.followed = float(loaded_dict.get("followed", 0.0))
        if self.discriminator is not None:
            self.discriminator.network.load_state_dict(loaded_dict["discriminator_state_dict"])
            self.discriminator.optimizer.load_state_dict(loaded_dict["discriminator_optimizer_state_dict"])
        return result

    def broadcast_parameters(self) -> None:
        """Give every process the first one's parameters, once; the runner asks for it at each call."""
        if self._synchronized:
            return
        super().broadcast_parameters()
        if self.discriminator is not None:
            states = [self.discriminator.network.state_dict()]
            torch.distributed.broadcast_object_list(states, src=0)
            self.discriminator.network.load_state_dict(states[0])
        self._synchronized = True

    def _mean_gradients(self, parameters: Iterable[torch.nn.Parameter]) -> None:
        for parameter in parameters:
            if parameter.grad is not None:
                torch.distributed.all_reduce(parameter.grad)
                parameter.grad /= self.gpu_world_size


def explained(returns: torch.Tensor, values: torch.Tensor) -> float:
    """1 - var(returns - values) / var(returns)."""
    return float(1.0 - (returns - values).var() / returns.var().clamp(min=1e-12))


def _grown(value: float, span: tuple[float, float]) -> float:
    """How far a value is from the first to the last of a span, 0..1; 1 where the span ends at 0."""
    first, last = span
    return min(1.0, max(0.0, (value - first) / max(last - first, 1e-9))) if last else 1.0
