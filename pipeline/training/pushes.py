"""Pushes: sudden changes of the base's velocity, and forces on the trunk for a tenth of a second."""

from __future__ import annotations

import math

import torch

from pipeline.training.masks import replace

FORCE_S = 0.1
"""How long a force acts [s]."""


def horizontal(count: int, least: float, device: str | torch.device) -> torch.Tensor:
    """Vectors (count, 3) in random horizontal directions, as shares of the largest push, `least` at least."""
    angle = 2.0 * math.pi * torch.rand(count, device=device)
    length = least + (1.0 - least) * torch.rand(count, device=device)
    return torch.stack([length * torch.cos(angle), length * torch.sin(angle), torch.zeros_like(angle)], dim=1)


class ComingPush:
    """The next push of each environment: drawn when the one before begins and when an episode does, so that it is
    known ahead (`foresight.py`)."""

    def __init__(self, env, largest: torch.Tensor):
        self._span, self._step_s = env.context.options.push_interval_s, env.step_dt
        self._pushed, self._largest = env.pushed, largest
        self._spared = None if env.context.options.tracked_pushed else env.tracked_clip
        self.left_s = torch.zeros(env.num_envs, device=env.device)
        """How long each is still left alone (n,) [s]."""
        self.since_s = torch.full((env.num_envs,), math.inf, device=env.device)
        """How long ago each was last pushed in this episode (n,) [s]."""
        self._share_w = torch.zeros(env.num_envs, 3, device=env.device)
        self._readings, self._sagittal = env.readings, env.context.options.push_sagittal
        self._least_share = env.context.options.push_least
        self._of_heading = torch.zeros_like(self._pushed)
        """Whose push (n,) is ahead or back of the robot as it is when it begins: `_share_w` is in the frame of its
        heading then, else in the world."""
        self._drawn(torch.ones_like(self.left_s, dtype=torch.bool))
        env.coming_pushes.append(self)
        env.restarts.append(self._restart)

    @property
    def push_w(self) -> torch.Tensor:
        """It (n, 3), in the world and in the unit of the ramp of the largest; 0 where nobody pushes."""
        pushed = self._pushed if self._spared is None else self._pushed & ~self._spared.tracks
        return self._turned() * self._largest * pushed[:, None]

    def begins(self) -> tuple[torch.Tensor, torch.Tensor]:
        """A control step later: who (n,) is pushed with this step, and by what (n, 3), of those."""
        self.left_s -= self._step_s
        self.since_s += self._step_s
        now, push_w = self.left_s <= 0.0, self.push_w
        replace(self.since_s, now & (push_w != 0.0).any(dim=1), 0.0)
        self._drawn(now)
        return now, push_w

    def _turned(self) -> torch.Tensor:
        """Shares (n, 3) in the world."""
        if not self._sagittal:
            return self._share_w
        (x, y, z), (cos, sin) = self._share_w.unbind(dim=1), self._readings.heading_w.unbind(dim=1)
        turned = torch.stack([x * cos - y * sin, x * sin + y * cos, z], dim=1)
        return torch.where(self._of_heading[:, None], turned, self._share_w)

    def _restart(self, mask: torch.Tensor) -> None:
        """Another episode: nobody was pushed in it yet."""
        replace(self.since_s, mask, math.inf)
        self._drawn(mask)

    def _drawn(self, mask: torch.Tensor) -> None:
        """Draw the next one of some anew."""
        low, high = self._span
        replace(self.left_s, mask, low + (high - low) * torch.rand_like(self.left_s))
        share = horizontal(len(mask), self._least_share, mask.device)
        if self._sagittal:
            chosen = torch.rand(len(mask), device=mask.device) < self._sagittal
            length = torch.linalg.norm(share, dim=1) * torch.sign(share[:, 0])
            straight = torch.nn.functional.pad(length[:, None], (0, 2))
            share = torch.where(chosen[:, None], straight, share)
            replace(self._of_heading, mask, chosen)
        replace(self._share_w, mask, share)


def recovery_left(env, recovery_s: float) -> torch.Tensor:
    """How much of the time [s] to recover from the latest push is left (n,): about 1 as it begins, 0 when it is over.
    It is that of the middle of a control step, so that its last step is the last that ends within it."""
    middle_s = since_push(env) + 0.5 * env.step_dt
    return (1.0 - middle_s / recovery_s).clamp(min=0.0)


def since_push(env) -> torch.Tensor:
    """How long ago the latest push of any kind began in this episode (n,) [s]; infinite where none did."""
    since_s = [coming.since_s for coming in env.coming_pushes]
    if not since_s:
        return torch.full((env.num_envs,), math.inf, device=env.device)
    return torch.stack(since_s).amin(dim=0)


class PushVelocity:
    """Every few seconds the base's velocity is another at once."""

    def __init__(self, cfg, env):
        self._coming = ComingPush(env, env.ramps.push_speed)

    def __call__(self, env, env_ids: torch.Tensor | None) -> None:
        now, change_w = self._coming.begins()
        velocity_w = env.sim.data.qvel[:, :3]
        velocity_w += torch.where(now[:, None], change_w, 0.0)


class PushForce:
    """Every few seconds a force on the trunk's centre of mass, for FORCE_S; `trunk_forces.py` brings it there."""

    def __init__(self, cfg, env):
        self._force_w = env.trunk_forces.push_w
        self._coming = ComingPush(env, env.ramps.push_impulse)
        self._left = torch.zeros(env.num_envs, device=env.device)
        env.restarts.append(self.restart)

    def __call__(self, env, env_ids: torch.Tensor | None) -> None:
        self._left -= env.step_dt
        now, impulse_w = self._coming.begins()
        replace(self._force_w, self._left <= 1e-6, 0.0)
        replace(self._force_w, now, impulse_w / FORCE_S)
        replace(self._left, now, FORCE_S)

    def restart(self, mask: torch.Tensor) -> None:
        """No push goes on from one episode to the next."""
        replace(self._left, mask, 0.0)
