"""Joints that the clips themselves teach: those that bear nothing and hardly swing, the elbows.

A leg's target is its joint's place and what the ground asks of its motor, which no clip says; an elbow's is the place.
So a network learns in minutes by least squares how arms are bent at each speed. By reward it did not: an episode that
tracks a clip begins with the clip's arms, and a network that keeps arms as it saw them last is right there; told
1.5 m/s from rest it never bent them.

Hence what they are told depends on the command alone: their mean over the clips' frames of that speed. And a third of
the robots move them as the next one is told to, for a second on average, so that wrong arms are seen too.
"""

from __future__ import annotations

import numpy as np
import torch

from pipeline.learning.training_error import TrainingError
from pipeline.training.action import SCALE
from pipeline.training.bundle import ExpertFrames

SPEEDS = np.arange(0.4, 2.15, 0.1)
"""Forward commands whose frames are averaged [m/s]; between them straight lines, beyond the last ones theirs."""
NEAR = (0.1, 0.15, 0.3)
"""How far a frame's command may be from one of them [m/s, m/s, rad/s]."""
LEAST = 100
"""Of fewer frames so near the nearest are taken."""
ASTRAY = 1 / 3
"""Share of the robots whose joints do what another is told."""
CHANGE = 0.02
"""Share of the robots for which that is drawn anew at each control step: once a second."""


class ClipTeacher:
    """What joints, by `parts` of their names, are told as robots walk ahead."""

    def __init__(self, env, parts: tuple[str, ...]):
        """Raises TrainingError for a part of no joint's name."""
        robot, expert, device = env.context.bundle.robot, env.context.bundle.expert, env.device
        for part in parts:
            if not any(part in name for name in robot.policy_joints):
                raise TrainingError(
                    f"--clip-joint is '{part}', which no joint has in its name: {', '.join(robot.policy_joints)}."
                )
        taken = tuple(name for name in robot.controlled if any(part in name for part in parts))
        self._told = torch.tensor([robot.policy_joints.index(name) for name in taken], device=device)
        joints = expert.frames[:, 7 + np.array([robot.controlled.index(name) for name in taken])]
        place = np.stack([joints[_frames_of(expert, speed)].mean(axis=0) for speed in SPEEDS.tolist()])
        action = (place - robot.default_joint_pos[robot.index(taken)]) / SCALE
        self._action = torch.from_numpy(action).float().to(device)
        self._led_astray = torch.zeros(env.num_envs, dtype=torch.bool, device=device)

    def tell(self, told: torch.Tensor, command: torch.Tensor, ahead: torch.Tensor) -> torch.Tensor:
        """Actions (n, a), those of its joints the clips' for who is `ahead` (n,) by commands (n, 3)."""
        at = ((command[:, 0] - SPEEDS[0]) / (SPEEDS[1] - SPEEDS[0])).clamp(0.0, len(SPEEDS) - 1.0)
        below = at.long().clamp(max=len(SPEEDS) - 2)
        own = torch.lerp(self._action[below], self._action[below + 1], (at - below)[:, None].float())
        changed = told.clone()
        changed[:, self._told] = torch.where(ahead[:, None], own, told[:, self._told])
        return changed

    def done(self, told: torch.Tensor, own: torch.Tensor) -> torch.Tensor:
        """What robots do (n, a) that would do `own`: some move these joints as the next one is told to."""
        draws = torch.rand(2, len(own), device=own.device)
        self._led_astray = torch.where(draws[0] < CHANGE, draws[1] < ASTRAY, self._led_astray)
        done = own.clone()
        others = told.roll(1, dims=0)[:, self._told]
        done[:, self._told] = torch.where(self._led_astray[:, None], others, own[:, self._told])
        return done


def _frames_of(expert: ExpertFrames, speed: float) -> np.ndarray:
    """Frames (k,) that go straight ahead at a speed [m/s], LEAST at least if there are as many."""
    away = (np.abs(expert.command - np.array([speed, 0.0, 0.0])) / np.array(NEAR)).max(axis=1)
    near = np.flatnonzero(away <= 1.0)
    return near if len(near) >= LEAST else np.argsort(away, kind="stable")[:LEAST]
