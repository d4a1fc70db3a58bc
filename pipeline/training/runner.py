"""The stage `amp`: AMP + PPO on the environment, from a distilled start or from scratch."""

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
"""Of actor and critic (paper)."""
FROZEN = 10**12
"""Sample count of a normalizer that no longer changes: a run adds some 10^8 samples. A normalizer that moves while the
critic learns alone leads the distilled actor astray."""


class ObservedEnvironment(RslRlVecEnvWrapper):
    """mjlab's wrapper for rsl_rl, with the observations of the last step instead of the managers' memory."""

    mirror: Mirror

    def get_observations(self) -> TensorDict:
        return TensorDict(self.unwrapped.get_observations(), batch_size=[self.num_envs])


class AmpStage(Stage):
    """AMP + PPO."""

    def __init__(self, bundle: Bundle, request: Request, folder: Path, start: dict[str, torch.Tensor] | None = None):
        """
        Args:
            bundle: what is trained on
            request: of the run
            folder: of the stage
            start: actor of the distillation; None: from scratch
        """
        config = request.config
        super().__init__(bundle, request, folder, config.schedule.iterations)
        seed = request.seed + 1000 * self.rank
        self.env = AmpEnvironment(bundle, config, request.device, seed, request.physics)
        wrapped = ObservedEnvironment(self.env)
        wrapped.mirror = Mirror(bundle.robot, request.device)
        windows = expert_windows(bundle.expert, config, request.seed)
        least = floors(len(bundle.robot.controlled))
        least = functional.pad(least, (0, windows.shape[2] - len(least)), value=COMMAND_FLOOR)
        torch.manual_seed(seed)
        warm_up = CRITIC_WARM_UP if start is not None else 0
        self.runner = OnPolicyRunner(wrapped, runner_cfg(config, windows, least, warm_up), None, request.device)
        self.algorithm: AmpPpo = self.runner.alg  # runner_cfg names it
        if start is not None:
            begin_with(self.algorithm.get_policy(), start)

    def iterate(self, share: float) -> dict[str, float]:
        algorithm = self.algorithm
        self._set_ramps(share)
        algorithm.iteration, algorithm.run_share = self.iteration, share
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
            "explained": algorithm.explained,
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


def begin_with(actor: Any, start: dict[str, torch.Tensor]) -> None:
    """Let the actor begin as a distilled one, its normalizer frozen; the deviation of its actions stays its own."""
    actor.load_state_dict(start, strict=False)
    actor.obs_normalizer.count.fill_(FROZEN)


def runner_cfg(config: Config, windows: torch.Tensor, least_std: torch.Tensor, warm_up: int) -> dict[str, Any]:
    """rsl_rl's configuration of the runner; see `AmpPpo` for the arguments."""
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
            # rsl_rl moves a value by at most 0.2 an update; one fall changes a return by 4
            "use_clipped_value_loss": False,
            "schedule": "adaptive",
            "rnd_cfg": None,
            "symmetry_cfg": {
                "data_augmentation_func": "pipeline.training.amp.symmetry:augment",
                "use_data_augmentation": True,
            },
            "config": config,
            "expert": windows,
            "least_std": least_std,
            "warm_up": warm_up,
        },
    }
