"""Observations of actor and critic.

The actor observes the 72 x 10 numbers of `pipeline/deployment/controller.py`, time-major, oldest frame first, zeros
before the episode; joints in the network's order. The critic: the newest frame without noise, and inputs of rewards.
"""

import torch
from mjlab.managers.observation_manager import ObservationGroupCfg, ObservationTermCfg

from pipeline.training.masks import replace

HISTORY = 10
"""Frames in the actor's observation."""
COMMAND = slice(6, 9)
"""Columns of the command in a frame."""
OBSERVATION_LIMIT = 100.0
"""Bound of observations, which protects the network from a diverging simulation."""
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
    """Build a frame (n, 9 + 3 a); joints in the network's order, positions relative to the default pose."""
    return torch.cat([gyro_b, gravity_b, command, joint_offset, joint_vel, last_action], dim=1)


def newest_frame(env) -> torch.Tensor:
    """The frame (n, 9 + 3 a) of the current state, without noise."""
    state, index = env.robot_state, env.policy_index
    newest = frame(
        state.ang_vel_b,
        state.gravity_b,
        env.command,
        (state.joint_pos - env.default_joint_pos)[:, index],
        state.joint_vel[:, index],
        env.action_manager.action,
    )
    return torch.nan_to_num(newest).clamp(-OBSERVATION_LIMIT, OBSERVATION_LIMIT)


def noise_scale(factor: float, joints: int) -> torch.Tensor:
    """Half width of the uniform noise of each number in a frame; 0 for command and last action."""
    gyro, gravity, pos, vel = (factor * width for width in NOISE)
    parts = [(gyro, 3), (gravity, 3), (0.0, 3), (pos, joints), (vel, joints), (0.0, joints)]
    return torch.cat([torch.full((size,), value) for value, size in parts])


class ActorHistory:
    """The last frames of each environment, with sensor noise."""

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
        """Zero the history of environments in `mask` (n,)."""
        replace(self._frames, mask, 0.0)


def critic_frame(env) -> torch.Tensor:
    """The newest frame, base velocity, averaged velocity (as in rewards) and foot contacts (n, 72 + 8)."""
    state = env.robot_state
    return torch.cat([newest_frame(env), state.lin_vel_b, state.mean_velocity, state.contacts.float()], dim=1)


def observation_cfg() -> dict[str, ObservationGroupCfg]:
    """Observation groups `actor` and `critic`."""
    return {
        "actor": ObservationGroupCfg(terms={"history": ObservationTermCfg(func=ActorHistory)}),
        "critic": ObservationGroupCfg(terms={"frame": ObservationTermCfg(func=critic_frame)}),
    }
