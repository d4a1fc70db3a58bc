"""What actor and critic see.

The actor's 72 x 10 numbers are those of `pipeline/deployment/observation.py`, time-major, the oldest frame first, zeros
where there is none yet; joints in the network's order. The critic sees the newest frame without noise, the base's
velocity, which feet touch, the clip that is tracked where clips are, and what is going to happen where
it has foresight.
"""

from __future__ import annotations

import torch
from mjlab.managers.observation_manager import ObservationGroupCfg, ObservationTermCfg

from pipeline.training.foresight import foreseen, signs
from pipeline.training.masks import replace

HISTORY = 10
COMMAND = slice(6, 9)
"""Where the command is in a frame."""
LARGEST = 100.0
"""Observations are cut here: only a simulation that has come apart gets beyond, which must not reach the network."""


def frame(
    gyro_b: torch.Tensor,
    gravity_b: torch.Tensor,
    command: torch.Tensor,
    joint_offset: torch.Tensor,
    joint_vel: torch.Tensor,
    last_action: torch.Tensor,
) -> torch.Tensor:
    """One frame (n, 9 + 3 a); joints in the network's order, positions counted from the default pose."""
    return torch.cat([gyro_b, gravity_b, command, joint_offset, joint_vel, last_action], dim=1)


def newest_frame(env) -> torch.Tensor:
    """The frame of the current state."""
    readings, index = env.readings, env.policy_index
    newest = frame(
        readings.ang_vel_b,
        readings.gravity_b,
        env.command,
        (readings.joint_pos - env.default_joint_pos)[:, index],
        readings.joint_vel[:, index],
        env.action_manager.action,
    )
    return torch.nan_to_num(newest).clamp(-LARGEST, LARGEST)


def newest_command(seen: torch.Tensor) -> torch.Tensor:
    """The command (n, 3) in the newest frame of what the actor sees (n, o)."""
    return seen.unflatten(1, (HISTORY, -1))[:, -1, COMMAND]


def noise_scale(noise: tuple[float, float, float, float], joints: int) -> torch.Tensor:
    """Half width of the uniform noise of each number of a frame; command and last action have none."""
    gyro, gravity, pos, vel = noise
    parts = [(gyro, 3), (gravity, 3), (0.0, 3), (pos, joints), (vel, joints), (0.0, joints)]
    return torch.cat([torch.full((size,), value) for value, size in parts])


class ActorHistory:
    """The last frames of each environment, with the sensors' noise."""

    def __init__(self, cfg: ObservationTermCfg, env):
        joints = len(env.policy_index)
        self._frames = torch.zeros(env.num_envs, HISTORY, 9 + 3 * joints, device=env.device)
        self._scale = noise_scale(env.context.options.noise, joints).to(env.device) * ~env.quiet[:, None]
        env.restarts.append(self.restart)

    def __call__(self, env) -> torch.Tensor:
        env.readings.fresh()
        newest = newest_frame(env)
        newest += self._scale * (2.0 * torch.rand_like(newest) - 1.0)
        self._frames.copy_(torch.cat([self._frames[:, 1:], newest[:, None]], dim=1))
        return self._frames.flatten(1)

    def restart(self, mask: torch.Tensor) -> None:
        """Nothing was seen before an episode."""
        replace(self._frames, mask, 0.0)


def critic_frame(env) -> torch.Tensor:
    """The newest frame, the base's velocity and the feet's contacts (n, 72 + 5); where clips are tracked, how near the
    clip is and whether there is one (n, 2); with `foresight` what it says (n, k)."""
    beyond = [] if env.tracked_clip is None else [env.tracked_clip.seen()]
    beyond += [foreseen(env)] if env.context.options.foresight else []
    return torch.cat([newest_frame(env), env.readings.lin_vel_b, env.readings.contacts.float(), *beyond], dim=1)


def beyond_signs(env) -> torch.Tensor:
    """By what each number that the critic sees beyond the feet is multiplied in a mirror (k,)."""
    clip = torch.ones(0 if env.tracked_clip is None else 2)
    return torch.cat([clip, signs(env)]) if env.context.options.foresight else clip


def observation_cfg() -> dict[str, ObservationGroupCfg]:
    """The groups `actor` and `critic`."""
    return {
        "actor": ObservationGroupCfg(terms={"history": ObservationTermCfg(func=ActorHistory)}),
        "critic": ObservationGroupCfg(terms={"frame": ObservationTermCfg(func=critic_frame)}),
    }
