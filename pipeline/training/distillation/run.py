"""The stage `distillation`: DAgger from the tracker.

Ross et al., "A reduction of imitation learning and structured prediction to no-regret online learning", AISTATS 2011:
the student acts, at first the teacher; the teacher labels every visited state with its action; the student fits the
labels by least squares. Rewards are not used. Every second sample is mirrored, so that the student is symmetric.
Checkpoints omit the labelled states; a resumed run collects new ones.
"""

import math
from pathlib import Path
from typing import Any, cast

import torch
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from pipeline.training.amp.algorithm import fast_matmul
from pipeline.training.amp.symmetry import Mirror
from pipeline.training.bundle import Bundle
from pipeline.training.distillation.memory import LabelledStates
from pipeline.training.distillation.teacher import ClipTeacher
from pipeline.training.environment import AmpEnvironment
from pipeline.training.mdp.observations import COMMAND, HISTORY, noise_scale
from pipeline.training.runner import NETWORK
from pipeline.training.stage import STEPS, Request, Stage

NORMALIZER_ITERATIONS = 5
"""Number of first iterations, in which the teacher acts and the normalizer is fitted."""
COMMAND_STD = 0.3
"""Lower bound of the normalizer's std of commands [m/s, rad/s]: few clips walk sideways."""
NOISE = 0.05
"""Std of the noise on the student's actions, so that states around its gait are labelled too."""
TEACHER_SHARE = 0.2
"""Part of the run over which the share of environments with the teacher's actions falls from 1 to 0."""
PASSES = 4.0
"""Average number of gradient passes over each new state."""
MEMORY, BATCH = 300_000, 4096
"""Buffer size and batch size in states; smaller with fewer environments."""
RATE, LAST_RATE = 1e-3, 0.05
"""Initial learning rate of Adam, and the final one as a share of it, with cosine decay."""


class DistillationStage(Stage):
    """Train one network with the deployment observation to imitate the tracker's joint targets."""

    def __init__(self, bundle: Bundle, request: Request, folder: Path):
        super().__init__(bundle, request, folder, request.config.distillation.iterations)
        assert bundle.teacher is not None, "checked by `chain.train`"
        config = request.config.changed({"simulation.terrain": "plane"})
        self.teacher = ClipTeacher(bundle.teacher, bundle.robot, config, request.device)
        self.env = AmpEnvironment(
            bundle,
            config,
            request.device,
            request.seed,
            request.physics,
            teacher=self.teacher,
            starts=self.teacher.starts(request.seed),
        )
        torch.manual_seed(request.seed)
        self._observation = self.env.reset()[0]["actor"].clone()
        actions, envs = len(bundle.robot.controlled), config.simulation.num_envs
        self.student = MLPModel(self._group(self._observation), {"actor": ["actor"]}, "actor", actions, **NETWORK).to(
            request.device
        )
        self._min_std = self._std_floor(noise_scale(config.randomization.noise, actions))
        self.optimizer = torch.optim.Adam(self.student.mlp.parameters(), lr=RATE)
        self._mirror = Mirror(bundle.robot, request.device)
        size = min(MEMORY, max(20_000, 2_000 * envs))
        self._memory = LabelledStates(size, self._observation.shape[1], actions, request.device)
        self._batch = min(BATCH, max(256, 8 * envs))

    @property
    def _workers(self) -> int:
        return 1

    def iterate(self, share: float) -> dict[str, float]:
        rate = RATE * (LAST_RATE + 0.5 * (1.0 - LAST_RATE) * (1.0 + math.cos(math.pi * share)))
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        fit_normalizer = self.iteration < NORMALIZER_ITERATIONS
        teacher_share = 1.0 if fit_normalizer else max(0.0, 1.0 - share / TEACHER_SHARE)
        loss = self._collect(teacher_share, fit_normalizer)
        if fit_normalizer:
            self._limit_normalizer()
        with fast_matmul(self.request.device):
            fit = self._fit_labels()
        self.environment_steps = self.env.common_step_counter
        record = self.env.record.take(self.env.step_dt)
        return {"loss": loss, "fit": fit, "teacher_share": teacher_share, "learning_rate": rate, **record}

    @torch.no_grad()
    def _collect(self, teacher_share: float, fit_normalizer: bool) -> float:
        """Run STEPS control steps and label them; return the student's mean squared action error."""
        env, total = self.env, torch.zeros((), device=self.env.device)
        by_teacher = (torch.rand(env.num_envs, device=env.device) < teacher_share)[:, None]
        self.student.train(fit_normalizer)
        for _ in range(STEPS):
            label, action = self.teacher.act(env), self._student_action(self._observation)
            self._memory.add(self._observation, label)
            self.student.update_normalization(self._group(self._observation))
            total += torch.square(action - label).mean()
            action = torch.where(by_teacher, label, action + NOISE * torch.randn_like(action))
            self.teacher.record_action(action)
            self._observation = env.step(action)[0]["actor"]
        return float(total) / STEPS

    def _fit_labels(self) -> float:
        """Run the least-squares gradient steps of an iteration; return their mean loss."""
        updates = max(1, round(PASSES * STEPS * self.env.num_envs / self._batch))
        total = torch.zeros((), device=self.env.device)
        for _ in range(updates):
            observation, label = self._memory.draw(self._batch)
            half = len(label) // 2
            observation = torch.cat([observation[:half], self._mirror.actor(observation[half:])])
            label = torch.cat([label[:half], self._mirror.actions(label[half:])])
            loss = torch.square(self._student_action(observation) - label).mean()
            self.optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(self.student.mlp.parameters(), 1.0)
            self.optimizer.step()
            total += loss.detach()
        return float(total) / updates

    def _student_action(self, observation: torch.Tensor) -> torch.Tensor:
        return self.student.mlp(self.student.obs_normalizer(observation))

    def _limit_normalizer(self) -> None:
        """Bound the normalizer's std from below: by the half width of the sensor noise, for commands by COMMAND_STD."""
        normalizer: Any = self.student.obs_normalizer
        normalizer._var.copy_(torch.maximum(normalizer._var, torch.square(self._min_std)))
        normalizer._std.copy_(torch.sqrt(normalizer._var))

    def _std_floor(self, noise: torch.Tensor) -> torch.Tensor:
        floor = noise.clone()
        floor[COMMAND] = COMMAND_STD
        return floor.repeat(HISTORY)[None].to(self.request.device)

    @staticmethod
    def _group(observation: torch.Tensor) -> TensorDict:
        return TensorDict(cast(Any, {"actor": observation}), batch_size=[len(observation)])

    def state(self) -> dict[str, Any]:
        return {
            "actor_state_dict": self.student.state_dict(),
            "critic_state_dict": {},
            "optimizer_state_dict": self.optimizer.state_dict(),
        }

    def load(self, state: dict[str, Any]) -> None:
        self.student.load_state_dict(state["actor_state_dict"])
        self.optimizer.load_state_dict(state["optimizer_state_dict"])
        self.env.common_step_counter = int(state["environment_steps"])

    def line(self, row: dict[str, float]) -> str:
        pairs = [
            f"{name} {row[f'{name}_achieved']:.2f}/{row[f'{name}_commanded']:.2f}" for name in ("slow", "mid", "turn")
        ]
        return (
            f"error {row['loss']:.4f}, teacher {row['teacher_share']:.2f}, {', '.join(pairs)}, "
            f"{row['falls_per_min']:.2f} falls/min, {row['lost_per_min']:.2f} tracking failures/min"
        )
