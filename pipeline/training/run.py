"""One training run from its options to its files."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import platform
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mjlab
import numpy as np
import torch
from mjlab.rl import RslRlVecEnvWrapper
from rsl_rl.runners import OnPolicyRunner
from tensordict import TensorDict

from pipeline.learning.checkpoint import load_checkpoint, newest_checkpoint, save_checkpoint
from pipeline.learning.curves_file import CurvesFile
from pipeline.learning.policy_file import policy_arrays, write_policy
from pipeline.learning.training_error import TrainingError
from pipeline.training.amp_ppo import AmpPpo
from pipeline.training.bundle import Bundle
from pipeline.training.curves import followed
from pipeline.training.environment import AmpEnvironment
from pipeline.training.expert_sampling import expert_windows
from pipeline.training.first_posture import begin_at, first_action
from pipeline.training.given_network import begin_with
from pipeline.training.mirror import Mirror
from pipeline.training.observations import beyond_signs
from pipeline.training.options import Options
from pipeline.training.presets import changed_from
from pipeline.training.start import check_start

SAVE_EVERY = 100
FOLLOW_RATE = 0.1
"""How much an iteration weighs in the share of the commands that is reached."""


@dataclass(frozen=True, kw_only=True)
class RunRequest:
    """What is asked of a run."""

    out: Path
    preset: str
    options: Options
    num_envs: int
    device: str
    seed: int
    iterations: int
    minutes: float | None
    resume: bool
    physics: str | None = None
    """`warp` or `plain`; None: what is faster on the device."""
    start_from: Path | None = None
    """A policy file whose network is begun with."""


class TrainedOn(RslRlVecEnvWrapper):
    """What rsl-rl trains on."""

    def get_observations(self) -> TensorDict:
        """Those of the environment; mjlab's wrapper would ask the manager, whose memory the next step writes over."""
        return TensorDict(self.unwrapped.get_observations(), batch_size=[self.num_envs])


class TrainingRun:
    """Environment, algorithm and files of a run."""

    def __init__(self, bundle: Bundle, request: RunRequest):
        going = request.resume and newest_checkpoint(request.out / "checkpoints") is not None
        check_start(request.options, request.start_from, going)
        self.bundle, self.request = bundle, request
        self.rank = int(os.getenv("RANK", "0"))
        seed = request.seed + 1000 * self.rank
        options = request.options
        env = AmpEnvironment(bundle, options, request.num_envs, request.device, seed, request.physics)
        self.env = env
        wrapped = TrainedOn(env)
        wrapped.mirror = Mirror(bundle.robot, request.device, beyond_signs(env))  # symmetry of mirror.py reads it
        windows = expert_windows(bundle.expert, options, request.seed)
        torch.manual_seed(seed)
        self.runner = OnPolicyRunner(
            wrapped, runner_cfg(options, windows, len(bundle.robot.controlled)), None, request.device
        )
        self.algorithm: AmpPpo = self.runner.alg  # runner_cfg names it
        if request.start_from is not None:
            begin_with(self.algorithm.get_policy(), request.start_from, bundle.robot)
            if options.keep:
                self.algorithm.keep_walk()
        elif options.init_posture == "clips":
            begin_at(self.algorithm.get_policy(), first_action(bundle, options, request.seed))
        self.iteration = 0
        """How many iterations are done."""
        if request.resume:
            self._resume()
        self._curves = CurvesFile(request.out / "curves.csv", self.iteration)

    @property
    def folder(self) -> Path:
        """Where checkpoints go."""
        return self.request.out / "checkpoints"

    def train(self) -> None:
        """Iterate until the wanted number or time is reached; every hundredth state is kept, and the last."""
        started, before = time.monotonic(), self._curves.seconds
        self._write_config()
        limit = self.request.minutes
        reason = "iterations"
        if self.iteration:
            self._begin_at(scheduled(self.request, self.iteration, self._agreed(before)))
        while self.iteration < self.request.iterations:
            begun = time.monotonic()
            passed = self._agreed(before + begun - started)
            if limit is not None and passed > 60.0 * limit:
                reason = "minutes"
                break
            self.runner.current_learning_iteration = self.iteration
            self.algorithm.iteration = self.env.schedule = scheduled(self.request, self.iteration, passed)
            self.runner.learn(1)
            self.iteration += 1
            now = time.monotonic()
            self._report(before + now - started, now - begun)
            if self.iteration % SAVE_EVERY == 0:
                self.save()
        self.save()
        self._finish(reason, before + time.monotonic() - started)

    def _begin_at(self, schedule: float) -> None:
        """Let all episodes begin anew, as they begin at that iteration: the environment was made for the first one."""
        self.env.schedule = schedule
        self.env.go_on()
        self.env.reset()

    def _agreed(self, seconds: float) -> float:
        """The first process's seconds in all of them: they end, and are in their schedules, together."""
        if not self.algorithm.is_multi_gpu:
            return seconds
        value = torch.tensor(seconds, dtype=torch.float64, device=self.request.device)
        torch.distributed.broadcast(value, src=0)
        return float(value)

    def save(self) -> None:
        """Checkpoint, policy and curves; only the first process writes."""
        if self.rank:
            return
        state = self.algorithm.save()
        save_checkpoint(self.folder, self.iteration, state, self.env.common_step_counter)
        write_policy(self.request.out / "policy.npz", policy_arrays(state, self.bundle.robot))
        self._curves.write()

    def _resume(self) -> None:
        path = newest_checkpoint(self.folder)
        if path is None:
            return
        state = load_checkpoint(path, self.request.device)
        try:
            self.algorithm.load(state, None, strict=True)
        except (RuntimeError, KeyError, ValueError, TypeError, AttributeError) as error:
            first = str(error).splitlines()[0]
            raise TrainingError(
                f"{path}: is of another network or setting; it can't be gone on from ({first})."
            ) from error
        self.iteration = int(state["iteration"])
        self.env.common_step_counter = int(state["environment_steps"])

    def _report(self, seconds: float, took: float) -> None:
        env_figures = self.env.record.take(self.env.step_dt)
        self._follow(env_figures)
        figures = {**self.algorithm.take_step_figures()}
        amp = self.algorithm.discriminator
        figures |= amp.figures if amp is not None and amp.figures else dict.fromkeys(AMP_COLUMNS, float("nan"))
        world = int(os.getenv("WORLD_SIZE", "1"))
        steps = self.request.num_envs * self.request.options.steps * world
        std = float(self.algorithm.get_policy().output_std.detach().mean())
        row = {
            "iteration": self.iteration,
            "seconds": seconds,
            "steps_per_s": steps / took,
            **figures,
            **env_figures,
            "followed": self.algorithm.followed,
            "style_share": self.algorithm.style_share(),
            "learning_rate": self.algorithm.learning_rate,
            "update_s": self.algorithm.update_s,
            "explained": self.algorithm.explained,
            "kept": self.algorithm.kept,
            "action_std": std,
        }
        if self.rank:
            return
        self._curves.add(row)
        if self.iteration % 10 == 0 or self.iteration < 10:
            self._curves.write()
        print(_line(row, self.request.iterations), flush=True)

    def _follow(self, figures: dict[str, float]) -> None:
        """Tell the algorithm which share of the commands is reached, averaged over some iterations."""
        now, known = followed(figures), self.algorithm.followed
        if now is not None:
            self.algorithm.followed = known + FOLLOW_RATE * (now - known)

    def _write_config(self) -> None:
        if self.rank == 0:
            _write_json(self.request.out / "config.json", self._config())

    def _started_from(self) -> str | None:
        """Digest of the policy that the run began with. Raises TrainingError where a run that goes on began with
        another one: the network is its checkpoint's."""
        given, config = self.request.start_from, self.request.out / "config.json"
        asked = hashlib.sha256(given.read_bytes()).hexdigest() if given is not None else None
        if not self.iteration or not config.is_file():
            return asked
        begun = json.loads(config.read_text()).get("start_from")
        if asked not in (None, begun):
            raise TrainingError(f"{given}: is not what the run in {self.request.out} began with; give another --out.")
        return begun

    def _config(self) -> dict[str, Any]:
        request = self.request
        return {
            "preset": request.preset,
            "options": dataclasses.asdict(request.options),
            "changed": changed_from(request.preset, request.options),
            "seed": request.seed,
            "num_envs": request.num_envs,
            "processes": int(os.getenv("WORLD_SIZE", "1")),
            "device": _device_name(request.device),
            "physics": self.env.physics,
            "start_from": self._started_from(),
            "bundle_digest": self.bundle.digest,
            "bundle": self.bundle.about,
            "versions": {
                "python": platform.python_version(),
                "torch": torch.__version__,
                "numpy": np.__version__,
                "mjlab": getattr(mjlab, "__version__", "1.6.0"),
            },
        }

    def _finish(self, reason: str, seconds: float) -> None:
        if self.rank:
            return
        request = self.request
        steps = self.iteration * request.num_envs * request.options.steps * int(os.getenv("WORLD_SIZE", "1"))
        done = {"reason": reason, "iterations": self.iteration, "seconds": seconds, "steps": steps}
        _write_json(request.out / "done.json", {**done, "steps_per_s": steps / max(seconds, 1e-9)})


def scheduled(request: RunRequest, iteration: int, seconds: float) -> float:
    """The iteration that schedules are at after some iterations and seconds of training, those of earlier processes
    among them."""
    planned, minutes = request.options.run_iterations, request.minutes
    if not planned or minutes is None:
        return float(iteration)
    return max(planned * seconds / (60.0 * minutes), planned * iteration / request.iterations)


AMP_COLUMNS = ("d_expert", "d_policy", "gradient_penalty")


def runner_cfg(options: Options, windows: torch.Tensor, joints: int) -> dict[str, Any]:
    """rsl-rl's configuration of the runner."""
    network = {
        "class_name": "MLPModel",
        "hidden_dims": list(options.hidden),
        "activation": "elu",
        "obs_normalization": True,
    }
    noise = {"class_name": "GaussianDistribution", "init_std": options.init_std, "std_type": "scalar"}
    mirror = "pipeline.training.mirror:augment"
    return {
        "num_steps_per_env": options.steps,
        "save_interval": SAVE_EVERY,
        "check_for_nan": False,
        "obs_groups": {"actor": ["actor"], "critic": ["critic"]},
        "actor": {**network, "distribution_cfg": noise},
        "critic": dict(network),
        "algorithm": {
            "class_name": "pipeline.training.amp_ppo:AmpPpo",
            "num_learning_epochs": options.epochs,
            "num_mini_batches": options.mini_batches,
            "learning_rate": options.learning_rate,
            "entropy_coef": options.entropy,
            "desired_kl": options.desired_kl,
            "use_clipped_value_loss": options.value_clip,
            "schedule": "adaptive",
            "rnd_cfg": None,
            "symmetry_cfg": {"data_augmentation_func": mirror, "use_data_augmentation": True}
            if options.symmetry
            else None,
            "options": options,
            "expert": windows,
            "joints": joints,
        },
    }


def _line(row: dict[str, float], iterations: int) -> str:
    pairs = [
        f"{name} {row[name + '_achieved']:.2f}/{row[name + '_commanded']:.2f}"
        for name in ("mid", "top", "side", "turn")
    ]
    style = f"task {row['task_reward']:.3f}, style {row['style_reward']:.3f}"
    d = f"D {row['d_expert']:.1f}/{row['d_policy']:.1f}"
    lost = f"stalls {row['stalls_per_min']:.1f}/min, strays {row['strays_per_min']:.1f}/min"
    ends = f"episodes {row['episode_s']:.1f} s, {lost}"
    steps = f"{row['mid_steps_per_min']:.0f} steps/min"
    head = f"iteration {row['iteration']} of {iterations}, {row['seconds']:.0f} s"
    gate = f"followed {row['followed']:.2f}, style share {row['style_share']:.2f}, deviation {row['action_std']:.2f}"
    return f"{head}: {style}, {d}, {', '.join(pairs)}, {steps}, {ends}, {gate}, {row['steps_per_s']:.0f} steps/s"


def _device_name(device: str) -> str:
    return torch.cuda.get_device_name(device) if device.startswith("cuda") else "cpu"


def _write_json(path: Path, value: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    part.write_text(json.dumps(value, indent=1, sort_keys=True) + "\n")
    part.replace(path)
