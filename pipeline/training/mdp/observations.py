"""Observations of actor and critic.

The actor's 72 x 10 numbers are those of `pipeline/deployment/controller.py`, time-major, the oldest frame first, zeros
before the episode; joints in the network's order. The critic: the newest frame without noise, and what rewards read.
"""

import torch
from mjlab.managers.observation_manager import ObservationGroupCfg, ObservationTermCfg

from pipeline.training.masks import replace

HISTORY = 10
"""Frames that the actor observes."""
COMMAND = slice(6, 9)
"""Columns of the command in a frame."""
LARGEST = 100.0
"""Observations are clipped here, so that a simulation that diverges does not reach the network."""
NOISE = (0.2, 0.05, 0.01, 0.5)
"""Half width of the uniform noise of gyro [rad/s], gravity, joint positions [rad] and velocities [rad/s] (paper)."""


def frame(
    gyro_b: torch.Tensor,
    gravity_b: torch.Tensor,
    command: torch.Tensor,
    joint_offset: torch.Tensor,
    joint_vel: torch.Tensor,
    last_action: torch.Tensor,
) -> torch.Tensor:
    """One frame (n, 9 + 3 a); joints in the network's order, positions relative to the default pose."""
    return torch.cat([gyro_b, gravity_b, command, joint_offset, joint_vel, last_action], dim=1)


def newest_frame(env) -> torch.Tensor:
    """The frame of the current state."""
    state, index = env.robot_state, env.policy_index
    newest = frame(
        state.ang_vel_b,
        state.gravity_b,
        env.command,
        (state.joint_pos - env.default_joint_pos)[:, index],
        state.joint_vel[:, index],
        env.action_manager.action,
    )
    return torch.nan_to_num(newest).clamp(-LARGEST, LARGEST)


def noise_scale(factor: float, joints: int) -> torch.Tensor:
    """Half width of the uniform noise of each number of a frame; command and last action have none."""
    gyro, gravity, pos, vel = (factor * width for width in NOISE)
    parts = [(gyro, 3), (gravity, 3), (0.0, 3), (pos, joints), (vel, joints), (0.0, joints)]
    return torch.cat([torch.full((size,), value) for value, size in parts])


class ActorHistory:
    """The last frames of each environment, with the sensors' noise."""

    def __init__(self, cfg: ObservationTermCfg, env):
        joints = len(env.policy_index)
        self._frames = torch.zeros(env.num_envs, HISTORY, 9 + 3 * joints, device=env.device)
        self._scale = noise_scale(env.context.config.randomization.noise, joints).to(env.device)
        env.restarts.append(self.restart)

    def __call__(self, env) -> torch.Tensor:
        env.robot_state.invalidate()
        newest = newest_frame(env)
        newest += self._scale * (2.0 * torch.rand_like(newest) - 1.0)
        self._frames.copy_(torch.cat([self._frames[:, 1:], newest[:, None]], dim=1))
        return self._frames.flatten(1)

    def restart(self, mask: torch.Tensor) -> None:
        """Empty the history of environments (n,) that begin an episode."""
        replace(self._frames, mask, 0.0)


def critic_frame(env) -> torch.Tensor:
    """The newest frame, the base's velocity, the averaged one that is rewarded, and the feet's contacts (n, 72 + 8)."""
    state = env.robot_state
    return torch.cat([newest_frame(env), state.lin_vel_b, state.mean_velocity, state.contacts.float()], dim=1)


def observation_cfg() -> dict[str, ObservationGroupCfg]:
    """The groups `actor` and `critic`."""
    return {
        "actor": ObservationGroupCfg(terms={"history": ObservationTermCfg(func=ActorHistory)}),
        "critic": ObservationGroupCfg(terms={"frame": ObservationTermCfg(func=critic_frame)}),
    }
