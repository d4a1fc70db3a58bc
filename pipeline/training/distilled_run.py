"""One network taught by several policies: a run from its request to its files.

DAgger (Ross et al., "A reduction of imitation learning and structured prediction to no-regret online learning",
AISTATS 2011): robots of the training environment do what the network says, at first what its teachers say; the
teachers say at each state what they would do; the network learns that, by least squares, of the newest states.
Rewards count for nothing here. The memory of states is not in a checkpoint: a run that goes on fills it anew, and so
ends with other numbers than one that was never interrupted.
"""

from __future__ import annotations

import dataclasses
import json
import math
import platform
import time
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from pipeline.learning.checkpoint import load_checkpoint, newest_checkpoint, save_checkpoint
from pipeline.learning.curves_file import CurvesFile
from pipeline.learning.policy_file import policy_arrays, write_policy
from pipeline.learning.training_error import TrainingError
from pipeline.training.bundle import Bundle
from pipeline.training.clip_teacher import ClipTeacher
from pipeline.training.distil_request import BATCH, DistilRequest, digest_of
from pipeline.training.environment import AmpEnvironment
from pipeline.training.given_network import begin_with
from pipeline.training.mirror import Mirror
from pipeline.training.presets import changed_from
from pipeline.training.roles import ROLES, Unsteadiness, is_of, role_of
from pipeline.training.taught_memory import TaughtMemory
from pipeline.training.teachers import Teachers

SAVE_EVERY = 100
STEPS = 24
"""Of each environment an iteration."""
NOISE = 0.05
"""Standard deviation of what is added to the network's actions, so that states around its walk are taught as well."""
LED_SHARE = 0.2
"""Share of the run in which the teachers' share of the robots goes from all to none."""
LAST_RATE = 0.05
"""The learning rate at last, of that at first; between them a half cosine."""
LARGEST_GRADIENT = 1.0


class DistilledRun:
    """Environment, teachers, network and files of a run."""

    def __init__(self, bundle: Bundle, request: DistilRequest):
        self.bundle, self.request = bundle, request
        self.teachers = Teachers(
            request.teachers,
            bundle.robot,
            request.device,
            request.walks,
            request.both_sides,
            request.with_error,
            request.beyond,
        )
        self.env = AmpEnvironment(
            bundle, request.options, request.num_envs, request.device, request.seed, request.physics
        )
        self._mirror = Mirror(bundle.robot, request.device) if request.mirror_roles else None
        self._unsteady = Unsteadiness(self.env, request.borders.unsteady_deg)
        self.clip_teacher = ClipTeacher(self.env, request.clip_joints) if request.clip_joints else None
        self.env.schedule = float(request.options.run_iterations or request.iterations)
        self.env.go_on()
        torch.manual_seed(request.seed)
        self._seen = self._begun()
        groups = TensorDict(cast(Any, {"actor": self._seen}), batch_size=[request.num_envs])
        self.student = MLPModel(
            groups,
            {"actor": ["actor"]},
            "actor",
            len(bundle.robot.controlled),
            hidden_dims=list(request.options.hidden),
            activation="elu",
            obs_normalization=True,
        ).to(request.device)
        begin_with(self.student, request.start_from or request.teachers["other"], bundle.robot)
        self.student.eval()  # the normalizer stays what the first network had
        self.optimizer = torch.optim.Adam(self.student.mlp.parameters(), lr=request.rate)
        self.iteration = 0
        """How many iterations are done."""
        if request.resume:
            self._resume()
        self.memory = TaughtMemory(request.memory, self._seen.shape[1], len(bundle.robot.controlled), request.device)
        self._curves = CurvesFile(request.out / "curves.csv", self.iteration)

    def train(self) -> None:
        """Iterate until the wanted number or time is reached; every hundredth state is kept, and the last."""
        request, started, before = self.request, time.monotonic(), self._curves.seconds
        request.out.mkdir(parents=True, exist_ok=True)
        _write_json(request.out / "config.json", self._config())
        reason = "iterations"
        while self.iteration < request.iterations:
            begun = time.monotonic()
            passed = before + begun - started
            if request.minutes is not None and passed > 60.0 * request.minutes:
                reason = "minutes"
                break
            figures = self._iterate(self._share_done(passed))
            self.iteration += 1
            now = time.monotonic()
            steps_per_s = STEPS * request.num_envs / (now - begun)
            self._curves.add(
                {"iteration": self.iteration, "seconds": before + now - started, "steps_per_s": steps_per_s, **figures}
            )
            losses = " ".join(f"{name} {figures[f'loss_{name}']:.4f}" for name in ROLES)
            print(
                f"iteration {self.iteration} of {request.iterations}, {before + now - started:.0f} s: {losses}, "
                f"{figures['falls_per_min']:.2f} falls a minute",
                flush=True,
            )
            if self.iteration % SAVE_EVERY == 0:
                self.save()
            elif self.iteration % 10 == 0:
                self._curves.write()
        self.save()
        seconds = before + time.monotonic() - started
        steps = self.iteration * STEPS * request.num_envs
        done = {"reason": reason, "iterations": self.iteration, "seconds": seconds, "steps": steps}
        _write_json(request.out / "done.json", {**done, "steps_per_s": steps / max(seconds, 1e-9)})

    def save(self) -> None:
        """Checkpoint, policy and curves."""
        state = {
            "actor_state_dict": self.student.state_dict(),
            "critic_state_dict": {},
            "optimizer_state_dict": self.optimizer.state_dict(),
        }
        out = self.request.out
        save_checkpoint(out / "checkpoints", self.iteration, state, self.env.common_step_counter)
        write_policy(out / "policy.npz", policy_arrays(state, self.bundle.robot))
        self._curves.write()

    def _begun(self) -> torch.Tensor:
        return self.env.reset()[0]["actor"].clone()

    def _share_done(self, seconds: float) -> float:
        """How much of the run is over, by iterations or by time, 0..1."""
        request = self.request
        by_time = 0.0 if request.minutes is None else seconds / (60.0 * request.minutes)
        return min(1.0, max(by_time, self.iteration / request.iterations))

    def _iterate(self, done: float) -> dict[str, float]:
        """Walk, and learn from what the teachers say of it."""
        rate = self.request.rate * (LAST_RATE + 0.5 * (1.0 - LAST_RATE) * (1.0 + math.cos(math.pi * done)))
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        off, count = self._walk(max(0.0, 1.0 - done / LED_SHARE))
        loss = self._learn()
        env_figures = self.env.record.take(self.env.step_dt)
        figures = {
            f"loss_{name}": float(off[role] / count[role]) if count[role] else math.nan
            for role, name in enumerate(ROLES)
        }
        return {**figures, "loss": loss, "learning_rate": rate, **env_figures}

    @torch.inference_mode()
    def _walk(self, led: float) -> tuple[torch.Tensor, torch.Tensor]:
        """Fill the memory by STEPS steps, a share of the robots led by the teachers; returns sums of squares of what
        the network was off by, mean over the joints, and counts, of each role (r,)."""
        env, request, size = self.env, self.request, len(ROLES)
        off, count = (torch.zeros(size, device=env.device) for _ in range(2))
        guided = (torch.rand(env.num_envs, device=env.device) < led)[:, None]
        for _ in range(STEPS):
            velocity = env.readings.mean_velocity
            role = role_of(env.command, self._unsteady.since(), request.borders, velocity, self.teachers.sloped(env))
            error = env.command - velocity
            told, own = self.teachers.act(self._seen, role, error), self._answer(self._seen)
            if self.clip_teacher is not None:
                told = self.clip_teacher.tell(told, env.command, is_of(role, request.clip_roles))
            self.memory.add(*self._as_learned(role, told))
            off.index_add_(0, role, torch.square(own - told).mean(dim=1))
            count.index_add_(0, role, torch.ones_like(role, dtype=torch.float32))
            own = own + NOISE * torch.randn_like(own)
            done = torch.where(guided, told, own)
            done = done if self.clip_teacher is None else self.clip_teacher.done(told, done)
            self._seen = env.step(done)[0]["actor"]
        return off, count

    def _as_learned(self, role: torch.Tensor, told: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """What is seen and told now, of half of those in roles that are mirrored as their mirror images. A walk that is
        taught alike on both sides is learned so: what is left to learn may else be more on one side."""
        if self._mirror is None:
            return self._seen, told
        half = torch.rand(len(role), device=role.device) < 0.5
        taken = (is_of(role, self.request.mirror_roles) & half)[:, None]
        seen = torch.where(taken, self._mirror.seen(self._seen), self._seen)
        return seen, torch.where(taken, self._mirror.actions(told), told)

    def _learn(self) -> float:
        """Steps of least squares; their mean loss."""
        request = self.request
        updates = max(1, round(request.passes * STEPS * request.num_envs / BATCH))
        total = torch.zeros((), device=request.device)
        for _ in range(updates):
            seen, told = self.memory.drawn(BATCH)
            loss = torch.square(self._answer(seen) - told).mean()
            self.optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(self.student.mlp.parameters(), LARGEST_GRADIENT)
            self.optimizer.step()
            total += loss.detach()
        return float(total) / updates

    def _answer(self, seen: torch.Tensor) -> torch.Tensor:
        return self.student.mlp(self.student.obs_normalizer(seen))

    def _resume(self) -> None:
        path = newest_checkpoint(self.request.out / "checkpoints")
        if path is None:
            return
        state = load_checkpoint(path, self.request.device)
        self._hold_to_config()
        try:
            self.student.load_state_dict(state["actor_state_dict"])
            self.optimizer.load_state_dict(state["optimizer_state_dict"])
        except (RuntimeError, KeyError, ValueError, TypeError, AttributeError) as error:
            first = str(error).splitlines()[0]
            raise TrainingError(f"{path}: is of another network; it can't be gone on from ({first}).") from error
        self.iteration = int(state["iteration"])
        self.env.common_step_counter = int(state["environment_steps"])

    def _hold_to_config(self) -> None:
        """Raises TrainingError where the run was begun with other teachers, or asked other things of them."""
        path = self.request.out / "config.json"
        begun = json.loads(path.read_text()) if path.is_file() else {}
        for name, asked in self.request.taught().items():
            nothing = type(asked)() if isinstance(asked, dict | list) else None  # in runs older than the option
            if other := _difference(name, begun.get(name, nothing), asked):
                raise TrainingError(f"{path}: the run was begun with {other}; ask the same, or give another --out.")

    def _started_from(self) -> str:
        """Digest of the policy that the run began with. Raises TrainingError where a run that goes on began with
        another one: the network is its checkpoint's."""
        given, path = self.request.start_from, self.request.out / "config.json"
        asked = digest_of(given or self.request.teachers["other"])
        if not self.iteration or not path.is_file():
            return asked
        begun = json.loads(path.read_text()).get("start_from")
        if given is not None and asked != begun:
            raise TrainingError(f"{given}: is not what the run in {self.request.out} began with; give another --out.")
        return begun

    def _config(self) -> dict[str, Any]:
        request = self.request
        return {
            "preset": request.preset,
            "options": dataclasses.asdict(request.options),
            "changed": changed_from(request.preset, request.options),
            **self.request.taught(),
            "start_from": self._started_from(),
            "seed": request.seed,
            "num_envs": request.num_envs,
            "iterations": request.iterations,
            "minutes": request.minutes,
            "memory": request.memory,
            "passes": request.passes,
            "rate": request.rate,
            "device": request.device if request.device == "cpu" else torch.cuda.get_device_name(request.device),
            "physics": self.env.physics,
            "bundle_digest": self.bundle.digest,
            "bundle": self.bundle.about,
            "versions": {
                "python": platform.python_version(),
                "torch": torch.__version__,
                "numpy": np.__version__,
            },
        }


def _difference(name: str, begun: Any, asked: Any) -> str | None:
    """What a run was begun with and what is asked of it now, of the first that differs; None where nothing does."""
    if isinstance(asked, dict) and isinstance(begun, dict):
        keys = sorted(begun.keys() | asked.keys())
        return next((found for key in keys if (found := _difference(key, begun.get(key), asked.get(key)))), None)
    was, now = ("none" if value is None else json.dumps(value) for value in (begun, asked))
    return None if begun == asked else f"{name} {was}, not {now}"


def _write_json(path: Path, values: dict[str, Any]) -> None:
    part = path.with_suffix(".part")
    part.write_text(json.dumps(values, indent=1, sort_keys=True) + "\n")
    part.replace(path)
