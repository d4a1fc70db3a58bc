"""The stage `amp`: AMP + PPO, from a distilled actor or from scratch."""

from pathlib import Path
from typing import Any

import torch
from mjlab.rl import RslRlVecEnvWrapper
from rsl_rl.runners import OnPolicyRunner
from tensordict import TensorDict
from torch.nn import functional

from pipeline.learning.runner import learn_once
from pipeline.training.amp.algorithm import CRITIC_WARM_UP, AmpPpo, ramp
from pipeline.training.amp.discriminator import FIGURES
from pipeline.training.amp.expert import expert_windows
from pipeline.training.amp.features import COMMAND_FLOOR, floors
from pipeline.training.amp.symmetry import Mirror
from pipeline.training.bundle import Bundle
from pipeline.training.config import Config
from pipeline.training.environment import AmpEnvironment
from pipeline.training.stage import STEPS, Request, Stage

NETWORK: dict[str, Any] = {
    "hidden_dims": [512, 256, 128],
    "activation": "elu",
    "obs_normalization": True,
}
"""Networks of actor and critic (paper)."""
FROZEN = 10**12
"""Sample count that freezes a normalizer: a run adds some 10^8 samples. A normalizer that changes during the critic's
warm-up degrades the distilled actor."""


class ObservedEnvironment(RslRlVecEnvWrapper):
    """mjlab's wrapper for rsl_rl that returns copies of the last step's observations, not the managers' buffers."""

    mirror: Mirror

    def get_observations(self) -> TensorDict:
        return TensorDict(self.unwrapped.get_observations(), batch_size=[self.num_envs])


class AmpStage(Stage):
    """AMP + PPO."""

    def __init__(self, bundle: Bundle, request: Request, folder: Path, start: dict[str, torch.Tensor] | None = None):
        """
        Args:
            bundle: training bundle
            request: what to train
            folder: folder of the stage
            start: distilled actor; None: from scratch
        """
        config = request.config
        super().__init__(bundle, request, folder, config.schedule.iterations)
        seed = request.seed + 1000 * self.rank
        self.env = AmpEnvironment(bundle, config, request.device, seed, request.physics)
        wrapped = ObservedEnvironment(self.env)
        wrapped.mirror = Mirror(bundle.robot, request.device)
        windows = expert_windows(bundle.expert, config, request.seed)
        min_std = floors(len(bundle.robot.controlled))
        min_std = functional.pad(min_std, (0, windows.shape[2] - len(min_std)), value=COMMAND_FLOOR)
        torch.manual_seed(seed)
        warm_up = CRITIC_WARM_UP if start is not None else 0
        self.runner = OnPolicyRunner(wrapped, runner_cfg(config, windows, min_std, warm_up), None, request.device)
        self.algorithm: AmpPpo = self.runner.alg  # set by runner_cfg
        if start is not None:
            load_distilled_actor(self.algorithm.get_policy(), start)

    def iterate(self, share: float) -> dict[str, float]:
        algorithm = self.algorithm
        self._set_ramps(share)
        algorithm.iteration, algorithm.progress = self.iteration, share
        learn_once(self.runner)
        self.environment_steps = self.env.common_step_counter
        amp: dict[str, float] = {} if algorithm.discriminator is None else algorithm.discriminator.figures
        return {
            **algorithm.take_step_figures(),
            **{name: amp.get(name, float("nan")) for name in FIGURES},
            **self.env.record.take(self.env.step_dt),
            "style_share": algorithm.style_share(),
            "disturbance": float(self.env.disturbance),
            "learning_rate": algorithm.learning_rate,
            "update_s": algorithm.update_s,
            "explained": algorithm.explained_variance,
            "action_std": float(algorithm.get_policy().output_std.detach().mean()),
        }

    def state(self) -> dict[str, Any]:
        return self.algorithm.save()

    def load(self, state: dict[str, Any]) -> None:
        self.algorithm.load(state, None, strict=True)
        self.env.common_step_counter = int(state["environment_steps"])

    def line(self, row: dict[str, float]) -> str:
        pairs = [
            f"{name} {row[f'{name}_achieved']:.2f}/{row[f'{name}_commanded']:.2f}" for name in ("mid", "top", "side")
        ]
        return (
            f"task {row['task_reward']:.3f}, style {row['style_reward']:.3f}, D {row['d_expert']:.1f}/"
            f"{row['d_policy']:.1f}, accuracy {row['accuracy']:.2f}, followed {row['followed']:.2f}, "
            f"{', '.join(pairs)}, {row['touchdowns_per_min']:.0f} touchdowns/min, {row['falls_per_min']:.2f} falls/min"
        )

    def _set_ramps(self, share: float) -> None:
        schedule = self.request.config.schedule
        self.env.set_disturbance(ramp(share, schedule.disturbance_ramp))
        self.env.final.fill_(ramp(share, schedule.final_ramp))


def load_distilled_actor(actor: Any, start: dict[str, torch.Tensor]) -> None:
    """Load a distilled actor and freeze its normalizer; the action std keeps its initial value."""
    actor.load_state_dict(start, strict=False)
    actor.obs_normalizer.count.fill_(FROZEN)


def runner_cfg(config: Config, windows: torch.Tensor, min_std: torch.Tensor, warm_up: int) -> dict[str, Any]:
    """Configuration of rsl_rl's runner; see `AmpPpo` for the arguments."""
    noise = {"class_name": "GaussianDistribution", "init_std": config.ppo.init_std, "std_type": "scalar"}
    return {
        "num_steps_per_env": STEPS,
        "check_for_nan": False,
        "obs_groups": {"actor": ["actor"], "critic": ["critic"]},
        "actor": {"class_name": "MLPModel", **NETWORK, "distribution_cfg": noise},
        "critic": {"class_name": "MLPModel", **NETWORK},
        "algorithm": {
            "class_name": "pipeline.training.amp.algorithm:AmpPpo",
            "num_learning_epochs": 5,
            "num_mini_batches": 4,
            "learning_rate": 1e-3,
            "entropy_coef": config.ppo.entropy,
            "desired_kl": config.ppo.desired_kl,
            # the clipped loss moves a value by at most 0.2 per update, but one fall changes a return by 4
            "use_clipped_value_loss": False,
            "schedule": "adaptive",
            "rnd_cfg": None,
            "symmetry_cfg": {
                "data_augmentation_func": "pipeline.training.amp.symmetry:augment",
                "use_data_augmentation": True,
            },
            "config": config,
            "expert": windows,
            "min_std": min_std,
            "warm_up": warm_up,
        },
    }
