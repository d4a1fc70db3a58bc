"""Start states of episodes: mostly frames of the expert or of reference clips, else near the default pose."""

import math
from dataclasses import dataclass

import numpy as np
import torch
from mjlab.utils.lab_api.math import quat_apply, quat_apply_inverse, quat_from_euler_xyz, quat_mul

from pipeline.training.bundle import ExpertFrames
from pipeline.training.masks import replace

LIFT_M = 0.02
"""Height added to start states, so that no sole penetrates the ground [m]."""
JOINT_NOISE = 0.02
"""Half width of the noise of start joint positions [rad]."""
SPEED_NOISE = 0.2
"""Half width of the noise of base velocities near the default pose [m/s, rad/s]."""


@dataclass(frozen=True, kw_only=True)
class StartStates:
    """T candidate start states, as tensors on the device."""

    root_pos: torch.Tensor
    """(t, 3) [m]; only the height is used."""
    root_quat: torch.Tensor
    """(t, 4) wxyz."""
    joint_pos: torch.Tensor
    """(t, j) in the robot's order [rad]."""
    lin_vel_w: torch.Tensor
    """(t, 3) [m/s]"""
    ang_vel_w: torch.Tensor
    """(t, 3) [rad/s]"""
    joint_vel: torch.Tensor
    """(t, j) [rad/s]"""
    command: torch.Tensor
    """(t, 3) velocity of each state [m/s, m/s, rad/s]."""
    drawn: torch.Tensor
    """(m,) sampled state indices; each episode begins at one of these, drawn uniformly."""
    kept_command: torch.Tensor
    """(m, 3) command to keep after starting there, NaN to sample one [m/s, m/s, rad/s]."""

    def draw(self, count: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Draw state indices (count,) and commands to keep (count, 3), else NaN."""
        row = torch.randint(len(self.drawn), (count,), device=self.drawn.device)
        return self.drawn[row], self.kept_command[row]


def expert_states(
    expert: ExpertFrames, drawn: np.ndarray, kept: np.ndarray, controlled: np.ndarray, default: np.ndarray, device: str
) -> StartStates:
    """Build start states from expert frames.

    Args:
        expert: T frames
        drawn: sampled frame indices (m,)
        kept: command to keep after starting there, else NaN (m, 3) [m/s, m/s, rad/s]
        controlled: indices of the frames' joints in the robot's order (a,)
        default: default joint positions (j,) [rad], for the other joints
        device: device of the tensors
    """
    frames, count = torch.from_numpy(expert.frames).to(device), len(controlled)
    after = 7 + count + 12
    joint_pos = torch.from_numpy(default).float().to(device).repeat(len(frames), 1)
    joint_vel = torch.zeros_like(joint_pos)
    joint_pos[:, controlled] = frames[:, 7 : 7 + count]
    joint_vel[:, controlled] = frames[:, after + 6 : after + 6 + count]
    quat = frames[:, 3:7].clone()
    return StartStates(
        root_pos=frames[:, :3].clone(),
        root_quat=quat,
        joint_pos=joint_pos,
        lin_vel_w=quat_apply(quat, frames[:, after : after + 3]),
        ang_vel_w=quat_apply(quat, frames[:, after + 3 : after + 6]),
        joint_vel=joint_vel,
        command=torch.from_numpy(expert.command).to(device),
        drawn=torch.from_numpy(drawn).to(device),
        kept_command=torch.from_numpy(kept).to(device),
    )


def write_starts(env, mask: torch.Tensor) -> None:
    """Write start states, `env.start_command` and `env.start_velocity` of environments in `mask` (n,).

    States are drawn for all environments and selected by the mask.
    """
    starts: StartStates = env.context.starts
    count, device = env.num_envs, env.device
    index, kept = starts.draw(count)
    at_default = (torch.rand(count, device=device) >= env.context.config.simulation.reference_share)[:, None]
    if env.teacher is not None:
        at_default = torch.zeros_like(at_default)
    pos, quat = starts.root_pos[index], starts.root_quat[index]
    joints, joint_vel = starts.joint_pos[index], starts.joint_vel[index]
    lin_vel_w, ang_vel_w = (
        torch.where(at_default, SPEED_NOISE * (2.0 * torch.rand_like(value) - 1.0), value)
        for value in (starts.lin_vel_w[index], starts.ang_vel_w[index])
    )
    pos[:, 2:] = torch.where(at_default, env.context.bundle.robot.default_root_height, pos[:, 2:]) + LIFT_M
    quat = torch.where(at_default, (torch.arange(4, device=device) == 0).float(), quat)
    joints = torch.where(at_default, env.default_joint_pos, joints)
    joint_vel = torch.where(at_default, 0.0, joint_vel)
    angle = 2.0 * math.pi * torch.rand(count, device=device)
    yaw = quat_from_euler_xyz(torch.zeros_like(angle), torch.zeros_like(angle), angle)
    quat, lin_vel_w, ang_vel_w = quat_mul(yaw, quat), quat_apply(yaw, lin_vel_w), quat_apply(yaw, ang_vel_w)
    joints = torch.clamp(joints + JOINT_NOISE * (2.0 * torch.rand_like(joints) - 1.0), *env.joint_limits)
    pos[:, :2] = 0.0
    pos[:, 2] += env.ground_m
    data = env.sim.data
    replace(data.qpos[:], mask, torch.cat([pos + env.scene.env_origins, quat, joints], dim=1))
    replace(data.qvel[:], mask, torch.cat([lin_vel_w, quat_apply_inverse(quat, ang_vel_w), joint_vel], dim=1))
    env.robot_state.restart(mask)
    replace(env.start_command, mask, torch.where(at_default, torch.nan, kept))
    replace(env.start_velocity, mask, torch.where(at_default, 0.0, starts.command[index]))
    if env.teacher is not None:
        env.teacher.begin(env, mask, index, angle)
