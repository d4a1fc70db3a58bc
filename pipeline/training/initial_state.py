"""How an episode begins: mostly at an expert frame, else near the default pose."""

from __future__ import annotations

import math

import torch
from mjlab.utils.lab_api.math import quat_apply, quat_apply_inverse, quat_from_euler_xyz, quat_mul

from pipeline.training.masks import replace

LIFT_M = 0.02
"""Expert frames are put this much higher, so that no sole begins in the ground [m]."""
JOINT_NOISE = 0.02
"""[rad]"""
SPEED_NOISE = 0.2
"""Of the base near the default pose [m/s, rad/s]."""


def write_starts(env, mask: torch.Tensor) -> None:
    """Write root and joint states of environments (n,) that begin an episode, and give some the frame's own command.

    States are drawn for all and taken by those.
    """
    options, count, device = env.context.options, env.num_envs, env.device
    frames, command, at = env.context.references.draw(count)
    pos, quat, joints, lin_vel_w, ang_vel_w, joint_vel = _of_frames(env, frames)
    home = (torch.rand(count, device=device) >= options.reference_share)[:, None]
    tracks = torch.zeros_like(home)
    if env.tracked_clip is not None:
        tracks = torch.rand(count, 1, device=device) < env.ramps.tracked
        if env.slopes is not None:
            tracks &= env.slopes.level[:, None]  # clips are level: upright and with soles flat is not both on a slope
        home &= ~tracks
    height = env.context.bundle.robot.default_root_height + LIFT_M
    pos[:, 2:] = torch.where(home, height, pos[:, 2:])
    quat = torch.where(home, (torch.arange(4, device=device) == 0).float(), quat)
    joints = torch.where(home, env.default_joint_pos, joints)
    joint_vel = torch.where(home, 0.0, joint_vel)
    lin_vel_w, ang_vel_w = (
        torch.where(home, SPEED_NOISE * (2.0 * torch.rand_like(drawn) - 1.0), drawn) for drawn in (lin_vel_w, ang_vel_w)
    )
    turn = quat_from_euler_xyz(
        *(torch.zeros(2, count, device=device)), 2.0 * math.pi * torch.rand(count, device=device)
    )
    quat, lin_vel_w, ang_vel_w = quat_mul(turn, quat), quat_apply(turn, lin_vel_w), quat_apply(turn, ang_vel_w)
    joints += JOINT_NOISE * (2.0 * torch.rand_like(joints) - 1.0)
    joints = torch.clamp(joints, *env.joint_limits)
    pos[:, :2] = 0.0
    pos[:, 2] += options.roughness_m if options.terrain == "rough" else 0.0
    data = env.sim.data
    replace(data.qpos[:], mask, torch.cat([pos + env.scene.env_origins, quat, joints], dim=1))
    replace(data.qvel[:], mask, torch.cat([lin_vel_w, quat_apply_inverse(quat, ang_vel_w), joint_vel], dim=1))
    env.readings.restart(mask)
    keeps = tracks | (~home & (torch.rand(count, 1, device=device) < options.reference_command_share))
    replace(env.own_command, mask, torch.where(keeps, command, torch.nan))
    replace(env.begun_command, mask, torch.where(home, 0.0, command))
    if env.tracked_clip is not None:
        env.tracked_clip.begin(mask, at, tracks[:, 0])


def _of_frames(env, frames: torch.Tensor) -> tuple[torch.Tensor, ...]:
    """Root position and quaternion, joints, world velocities of the root and joint velocities of expert frames."""
    index = env.controlled_index
    count = len(index)
    pos, quat = frames[:, :3].clone(), frames[:, 3:7].clone()
    joints, joint_vel = (env.default_joint_pos.repeat(len(frames), 1) for _ in range(2))
    joint_vel[:] = 0.0
    joints[:, index] = frames[:, 7 : 7 + count]
    after = 7 + count + 12
    lin_vel_w = quat_apply(quat, frames[:, after : after + 3])
    ang_vel_w = quat_apply(quat, frames[:, after + 3 : after + 6])
    joint_vel[:, index] = frames[:, after + 6 : after + 6 + count]
    pos[:, 2] += LIFT_M
    return pos, quat, joints, lin_vel_w, ang_vel_w, joint_vel
