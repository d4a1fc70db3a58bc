"""States that episodes begin at: mostly frames of the expert or of reference clips, else near the default pose."""

import math
from dataclasses import dataclass

import numpy as np
import torch
from mjlab.utils.lab_api.math import quat_apply, quat_apply_inverse, quat_from_euler_xyz, quat_mul

from pipeline.training.bundle import ExpertFrames
from pipeline.training.masks import replace

LIFT_M = 0.02
"""Frames are lifted by this much, so that no sole begins in the ground [m]."""
JOINT_NOISE = 0.02
"""[rad]"""
SPEED_NOISE = 0.2
"""Of the base near the default pose [m/s, rad/s]."""


@dataclass(frozen=True, kw_only=True)
class StartStates:
    """T states to draw from, as tensors on the device."""

    root_pos: torch.Tensor
    """(t, 3) [m]; only the height counts."""
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
    """(t, 3) that each state obeys [m/s, m/s, rad/s]."""
    drawn: torch.Tensor
    """(m,) indices of states; an episode begins at one of them, drawn uniformly."""
    own: torch.Tensor
    """(m, 3) command that an episode there keeps, NaN where it draws one [m/s, m/s, rad/s]."""

    def draw(self, count: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Indices (count,) of states, and commands (count, 3) that are kept, else NaN."""
        at = torch.randint(len(self.drawn), (count,), device=self.drawn.device)
        return self.drawn[at], self.own[at]


def expert_states(
    expert: ExpertFrames, drawn: np.ndarray, own: np.ndarray, controlled: np.ndarray, default: np.ndarray, device: str
) -> StartStates:
    """Start states of expert frames.

    Args:
        expert: T frames
        drawn: frames that episodes begin at (m,)
        own: command that an episode there keeps, else NaN (m, 3) [m/s, m/s, rad/s]
        controlled: indices of the frames' joints in the robot's order (a,)
        default: default joint positions (j,) [rad], for the other joints
        device: where the tensors go
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
        own=torch.from_numpy(own).to(device),
    )


def write_starts(env, mask: torch.Tensor) -> None:
    """Write root and joint states of environments (n,) that begin an episode, and `env.own_command` of some.

    States are drawn for all environments and chosen by the mask.
    """
    starts: StartStates = env.context.starts
    count, device = env.num_envs, env.device
    at, own = starts.draw(count)
    home = (torch.rand(count, device=device) >= env.context.config.simulation.reference_share)[:, None]
    if env.teacher is not None:
        home = torch.zeros_like(home)
    pos, quat = starts.root_pos[at], starts.root_quat[at]
    joints, joint_vel = starts.joint_pos[at], starts.joint_vel[at]
    lin_vel_w, ang_vel_w = (
        torch.where(home, SPEED_NOISE * (2.0 * torch.rand_like(value) - 1.0), value)
        for value in (starts.lin_vel_w[at], starts.ang_vel_w[at])
    )
    pos[:, 2:] = torch.where(home, env.context.bundle.robot.default_root_height, pos[:, 2:]) + LIFT_M
    quat = torch.where(home, (torch.arange(4, device=device) == 0).float(), quat)
    joints = torch.where(home, env.default_joint_pos, joints)
    joint_vel = torch.where(home, 0.0, joint_vel)
    angle = 2.0 * math.pi * torch.rand(count, device=device)
    turn = quat_from_euler_xyz(torch.zeros_like(angle), torch.zeros_like(angle), angle)
    quat, lin_vel_w, ang_vel_w = quat_mul(turn, quat), quat_apply(turn, lin_vel_w), quat_apply(turn, ang_vel_w)
    joints = torch.clamp(joints + JOINT_NOISE * (2.0 * torch.rand_like(joints) - 1.0), *env.joint_limits)
    pos[:, :2] = 0.0
    pos[:, 2] += env.ground_m
    data = env.sim.data
    replace(data.qpos[:], mask, torch.cat([pos + env.scene.env_origins, quat, joints], dim=1))
    replace(data.qvel[:], mask, torch.cat([lin_vel_w, quat_apply_inverse(quat, ang_vel_w), joint_vel], dim=1))
    env.robot_state.restart(mask)
    replace(env.own_command, mask, torch.where(home, torch.nan, own))
    replace(env.start_velocity, mask, torch.where(home, 0.0, starts.command[at]))
    if env.teacher is not None:
        env.teacher.begin(env, mask, at, angle)
