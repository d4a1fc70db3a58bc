"""Training run of a tracker, from a bundle to checkpoints, curves and the tracker file."""

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from mjlab.rl import RslRlVecEnvWrapper
from rsl_rl.runners import OnPolicyRunner
from tensordict import TensorDict

from pipeline.learning.checkpoint import load_checkpoint, newest_checkpoint, save_checkpoint
from pipeline.learning.curves_file import CurvesFile
from pipeline.learning.policy_file import write_policy
from pipeline.learning.run_command import device_name, versions, write_json
from pipeline.learning.runner import learn_once
from pipeline.learning.training_error import TrainingError
from pipeline.tracking.bundle import CONFIG, TrackingBundle, check_trained_on
from pipeline.tracking.environment import tracking_environment
from pipeline.tracking.tracker_file import tracker_arrays

SAVE_EVERY = 100
"""Iterations between checkpoints."""
STEPS = 24
"""Control steps of each environment per iteration."""


@dataclass(frozen=True, kw_only=True)
class TrackingRequest:
    """Options of a run."""

    out: Path
    num_envs: int
    device: str
    seed: int
    iterations: int
    minutes: float | None
    resume: bool


class LoggedEnvironment(RslRlVecEnvWrapper):
    """mjlab's wrapper for rsl_rl that also accumulates the environment's episode logs."""

    def __init__(self, env):
        super().__init__(env)
        self._clear()

    def _clear(self) -> None:
        self._sums: dict[str, float] = {}
        self._counts: dict[str, int] = {}
        self._reward, self._steps, self._ended, self._failed = 0.0, 0, 0.0, 0.0

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict]:
        observations, reward, dones, extras = super().step(actions)
        self._reward += reward.mean()
        self._ended += dones.float().mean()
        self._failed += self.unwrapped.reset_terminated.float().mean()
        self._steps += 1
        for name, value in extras.get("log", {}).items():
            if name.startswith("Metrics/"):
                self._sums[name] = self._sums.get(name, 0.0) + value
                self._counts[name] = self._counts.get(name, 0) + 1
        return observations, reward, dones, extras

    def take(self) -> dict[str, float]:
        """Means since the last call: reward per step, episode length [s], failures per minute, tracking errors."""
        step_s = self.unwrapped.step_dt
        steps = max(self._steps, 1)
        ended, failed = float(self._ended) / steps, float(self._failed) / steps
        figures = {
            "reward": float(self._reward) / steps,
            "episode_s": step_s / ended if ended else float("nan"),
            "failures_per_min": failed * 60.0 / step_s,
        }
        for name in ("error_body_pos", "error_joint_pos", "error_anchor_pos"):
            key = f"Metrics/motion/{name}"
            figures[name] = float(self._sums[key]) / self._counts[key] if key in self._sums else float("nan")
        self._clear()
        return figures


class TrackingRun:
    """Environment, algorithm and files of a run."""

    def __init__(self, bundle: TrackingBundle, request: TrackingRequest):
        self.bundle, self.request = bundle, request
        self.rank, self.world = int(os.getenv("RANK", "0")), int(os.getenv("WORLD_SIZE", "1"))
        if newest_checkpoint(self.folder) is not None:
            if not request.resume:
                raise TrainingError(f"{request.out}: has a run. Give --resume to continue it, or another --out.")
            check_trained_on(bundle, request.out)
        seed = request.seed + 1000 * self.rank
        motion_file = request.out / f"motions_{self.rank}.npz"
        env = tracking_environment(bundle, motion_file, request.num_envs, request.device, seed)
        motion_file.unlink()
        self.env = LoggedEnvironment(env)
        torch.manual_seed(seed)
        self.runner = OnPolicyRunner(self.env, runner_cfg(), None, request.device)
        self.iteration, self.environment_steps = 0, 0
        if request.resume:
            self._resume()
        self._curves = CurvesFile(request.out / "curves.csv", self.iteration)

    @property
    def folder(self) -> Path:
        """Folder of the checkpoints."""
        return self.request.out / "checkpoints"

    def train(self) -> None:
        """Train until `iterations` or `minutes` are reached; minutes before a resume are included."""
        before, started = self._curves.seconds, time.monotonic()
        if self.rank == 0:
            write_json(self.request.out / CONFIG, self._config())
        reason = "iterations"
        while self.iteration < self.request.iterations:
            begun = time.monotonic()
            if self._out_of_time(before + begun - started):
                reason = "minutes"
                break
            self.runner.current_learning_iteration = self.iteration
            learn_once(self.runner)
            self.iteration += 1
            self._report(before + time.monotonic() - started, time.monotonic() - begun)
            if self.iteration % SAVE_EVERY == 0:
                self.save()
        self.save()
        if self.rank == 0:
            seconds = before + time.monotonic() - started
            steps = self.iteration * self.request.num_envs * STEPS * self.world
            done = {"reason": reason, "iterations": self.iteration, "seconds": seconds, "steps": steps}
            write_json(self.request.out / "done.json", done)

    def save(self) -> None:
        """Write checkpoint, tracker file and curves, in the first process only.

        Raises TrainingError, without a checkpoint, if the network diverged.
        """
        if self.rank:
            return
        state = self.runner.alg.save()
        try:
            arrays = tracker_arrays(state, self.bundle.robot)
        except TrainingError as error:
            do = "With --resume it continues from the checkpoint before."
            raise TrainingError(f"{self.request.out}, iteration {self.iteration}: {error} {do}") from error
        save_checkpoint(self.folder, self.iteration, state, self.env.unwrapped.common_step_counter)
        write_policy(self.request.out / "tracker.npz", arrays)
        self._curves.write()

    def _out_of_time(self, seconds: float) -> bool:
        """Whether the time limit is reached; all processes use the first one's clock."""
        limit = self.request.minutes
        if limit is None:
            return False
        if self.world > 1:
            value = torch.tensor(seconds, dtype=torch.float64, device=self.request.device)
            torch.distributed.broadcast(value, src=0)
            seconds = float(value)
        return seconds > 60.0 * limit

    def _resume(self) -> None:
        path = newest_checkpoint(self.folder)
        if path is None:
            return
        state = load_checkpoint(path, self.request.device)
        try:
            self.runner.alg.load(state, None, strict=True)
        except (RuntimeError, KeyError, ValueError, TypeError, AttributeError) as error:
            problem = f"is of another network or robot and can't be resumed ({str(error).splitlines()[0]})"
            raise TrainingError(f"{path}: {problem}. Give another --out.") from error
        self.iteration = int(state["iteration"])
        self.env.unwrapped.common_step_counter = int(state["environment_steps"])

    def _report(self, seconds: float, took: float) -> None:
        figures = self.env.take()
        if self.rank:
            return
        algorithm: Any = self.runner.alg
        row = {
            "iteration": self.iteration,
            "seconds": seconds,
            "steps_per_s": self.request.num_envs * STEPS * self.world / took,
            **figures,
            "learning_rate": float(algorithm.learning_rate),
            "action_std": float(algorithm.get_policy().output_std.detach().mean()),
        }
        self._curves.add(row)
        if self.iteration % 10 == 0 or self.iteration < 10:
            self._curves.write()
        left_s = (self.request.iterations - self.iteration) * took
        if self.request.minutes is not None:
            left_s = min(left_s, 60.0 * self.request.minutes - seconds)
        left = f"{max(left_s, 0.0) / 60.0:.1f} min left"
        print(
            f"iteration {self.iteration} of {self.request.iterations}, {seconds:.0f} s, {left}: "
            f"reward {row['reward']:.4f}, episodes {row['episode_s']:.1f} s, "
            f"failures {row['failures_per_min']:.2f}/min, body error {100 * row['error_body_pos']:.1f} cm, "
            f"deviation {row['action_std']:.2f}, {row['steps_per_s']:.0f} steps/s",
            flush=True,
        )

    def _config(self) -> dict[str, Any]:
        request = self.request
        return {
            "seed": request.seed,
            "num_envs": request.num_envs,
            "processes": self.world,
            "device": device_name(request.device),
            "bundle_digest": self.bundle.digest,
            "bundle": self.bundle.about,
            "algorithm": runner_cfg(),
            "versions": versions(),
        }


def runner_cfg() -> dict[str, Any]:
    """rsl_rl's configuration: mjlab's PPO settings for tracking, with less exploration around a reference."""
    layers = [512, 256, 128]
    network = {"class_name": "MLPModel", "hidden_dims": layers, "activation": "elu", "obs_normalization": True}
    noise = {"class_name": "GaussianDistribution", "init_std": 0.6, "std_type": "scalar"}
    return {
        "num_steps_per_env": STEPS,
        "save_interval": SAVE_EVERY,
        "check_for_nan": False,
        "obs_groups": {"actor": ["actor"], "critic": ["critic"]},
        "actor": {**network, "distribution_cfg": noise},
        "critic": dict(network),
        "algorithm": {
            "class_name": "PPO",
            "value_loss_coef": 1.0,
            "use_clipped_value_loss": True,
            "clip_param": 0.2,
            "entropy_coef": 0.002,
            "num_learning_epochs": 5,
            "num_mini_batches": 4,
            "learning_rate": 1.0e-3,
            "schedule": "adaptive",
            "gamma": 0.99,
            "lam": 0.95,
            "desired_kl": 0.01,
            "max_grad_norm": 1.0,
            "rnd_cfg": None,
            "symmetry_cfg": None,
        },
    }
