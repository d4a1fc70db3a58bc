"""Expert frames as a policy would have met them: its observations, and the actions that their joint targets are."""

from __future__ import annotations

import torch
from mjlab.utils.lab_api.math import quat_apply_inverse

from pipeline.training.action import SCALE
from pipeline.training.bundle import ExpertFrames, RobotFacts
from pipeline.training.observations import HISTORY, LARGEST, frame

WHOLE_SHARE = 0.8
"""Of the observations have their whole history; the others are of an episode that began a few frames ago."""
TILT = 0.03
"""Of gravity's direction [1], one draw an observation …"""
OFFSET = 0.04
"""… and of joint positions [rad]: how a robot is off the motion while it follows it."""
NOISE = {"gyro": 0.2, "joint_pos": 0.02, "joint_vel": 0.6, "action": 0.5}
"""Standard deviations [rad/s, rad, rad/s, 1], drawn for each frame: of sensors, and of actions that explore."""


class Cloning:
    """Draws of observations (n, HISTORY x f) and actions (n, a) of a bundle's expert frames."""

    def __init__(self, expert: ExpertFrames, robot: RobotFacts, device: str):
        frames = torch.from_numpy(expert.frames).to(device)
        target = torch.from_numpy(expert.target).to(device)
        start = torch.from_numpy(expert.clip_start).to(device)
        count = expert.controlled
        order = torch.tensor([robot.controlled.index(name) for name in robot.policy_joints], device=device)
        default = torch.from_numpy(robot.default_joint_pos[robot.index(robot.policy_joints)]).to(frames)
        down = torch.tensor([0.0, 0.0, -1.0], device=device).expand(len(frames), 3)
        self._action = target / SCALE
        self._first = torch.repeat_interleave(start[:-1], torch.diff(start))
        """Where the clip of each frame begins."""
        before = (torch.arange(len(frames), device=device) - 1).maximum(self._first)
        self._frames = frame(
            frames[:, 22 + count : 25 + count],
            quat_apply_inverse(frames[:, 3:7], down),
            torch.from_numpy(expert.command).to(frames),
            frames[:, 7 : 7 + count][:, order] - default,
            frames[:, 25 + count : 25 + 2 * count][:, order],
            self._action[before],
        )
        self._joints = count

    def draw(self, count: int, disturbed: bool) -> tuple[torch.Tensor, torch.Tensor]:
        """Observations as the actor sees them, oldest frame first, and what the motion does next.

        Sensors and actions are noisy; `disturbed`, the robot is also off the motion, whose next action is the same: a
        network that only learns by that learns to take no notice of where it leans.
        """
        device, joints = self._frames.device, self._joints
        at = torch.randint(len(self._frames), (count,), device=device)
        ages = torch.arange(HISTORY - 1, -1, -1, device=device)
        lived = torch.randint(1, HISTORY + 1, (count, 1), device=device)
        lived[torch.rand(count, device=device) < WHOLE_SHARE] = HISTORY
        lived = lived.minimum((at - self._first[at] + 1)[:, None])
        seen = self._frames[(at[:, None] - ages).clamp(min=0)]
        seen = seen + self._disturbance(count, float(disturbed))
        seen[..., 9 + 2 * joints :] *= (ages < lived - 1)[..., None]
        seen *= (ages < lived)[..., None]
        return seen.flatten(1).clamp(-LARGEST, LARGEST), self._action[at]

    def _disturbance(self, count: int, off: float) -> torch.Tensor:
        def normal(frames: int, size: int, deviation: float) -> torch.Tensor:
            return (deviation * torch.randn(count, frames, size, device=device)).expand(-1, HISTORY, -1)

        device, joints = self._frames.device, self._joints
        parts = [
            normal(HISTORY, 3, NOISE["gyro"]),
            normal(1, 3, off * TILT),
            torch.zeros(count, HISTORY, 3, device=device),
            normal(1, joints, off * OFFSET) + normal(HISTORY, joints, NOISE["joint_pos"]),
            normal(HISTORY, joints, NOISE["joint_vel"]),
            normal(HISTORY, joints, NOISE["action"]),
        ]
        return torch.cat(parts, dim=2)


class Imitation:
    """Gradient steps of an actor towards the clips' actions, beside those of PPO."""

    def __init__(self, actor: torch.nn.Module, draws: Cloning, batch: int):
        self._actor, self._draws, self._batch = actor, draws, batch
        self._parameters = [value for name, value in actor.named_parameters() if name.startswith("mlp.")]
        self._optimizer = torch.optim.Adam(self._parameters)

    def pretrain(self, steps: int, rate: float) -> float:
        """From a fresh network, its normalizer set by the clips, with a falling rate; the last loss."""
        for _ in range(20):
            self._actor.obs_normalizer.update(self._draws.draw(10 * self._batch, True)[0])  # type: ignore[operator]  # a module
        loss = float("nan")
        for step in range(steps):
            loss = self.step(rate * (1.0 - 0.95 * step / steps), True)
        return loss

    def step(self, rate: float, disturbed: bool = False) -> float | torch.Tensor:
        """One step at this rate; the loss before it."""
        observation, action = self._draws.draw(self._batch, disturbed)
        said = self._actor.mlp(self._actor.obs_normalizer(observation))  # type: ignore[operator]  # modules
        loss = torch.square(said - action).mean()
        self._optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self._parameters, 1.0)
        for group in self._optimizer.param_groups:
            group["lr"] = rate
        self._optimizer.step()
        return loss.detach()
