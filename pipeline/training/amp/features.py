"""Motion features of a frame, for expert and policy.

60 numbers for 21 joints: q, hand and foot positions and trunk velocities in the trunk frame, dq. Velocities of both are
central differences of positions, as in `pipeline/expert/frames.py`: simulator velocities contain vibration within two
control steps, by which a discriminator could recognize the policy.
"""

import torch

from pipeline.training.bundle import FPS

FLOORS = {"joint_pos": 0.1, "ends": 0.05, "lin_vel": 0.2, "ang_vel": 0.3, "joint_vel": 1.0}
"""Lower bound of the standard deviations that divide features [rad, m, m/s, rad/s, rad/s]: features that are nearly
constant in the data must not dominate."""
COMMAND_FLOOR = 0.2
"""Lower bound of the standard deviation of commands in discriminator input [m/s, rad/s]."""
CLIP = 10.0
"""Bound of normalized features."""


def positions(
    root_pos_w: torch.Tensor, root_rotation_w: torch.Tensor, joint_pos: torch.Tensor, ends_pos_w: torch.Tensor
) -> torch.Tensor:
    """Concatenate simulator states (n, 24 + a): joints (n, a) in the expert's order, hands and feet (n, 4, 3) in the
    world; `root_rotation_w` (n, 3, 3) rotates the root frame to the world frame."""
    return torch.cat([root_pos_w, root_rotation_w.flatten(1), joint_pos, ends_pos_w.flatten(1)], dim=1)


def state_features(states: torch.Tensor) -> torch.Tensor:
    """Features (n, 18 + 2 a) of the middle of three consecutive `positions` (n, 3, 24 + a)."""
    root_pos, root_rotation, joint_pos, ends_pos = torch.split(states, [3, 9, states.shape[2] - 24, 12], dim=2)
    rotation, rate = root_rotation.unflatten(2, (3, 3)), 0.5 * FPS
    lin_vel_w = rate * (root_pos[:, 2] - root_pos[:, 0])
    ang_vel_w = rate * rotation_vector(torch.bmm(rotation[:, 2], rotation[:, 0].mT))
    ends = ends_pos[:, 1].unflatten(1, (4, 3)) - root_pos[:, 1, None]
    in_trunk = torch.bmm(torch.cat([ends, lin_vel_w[:, None], ang_vel_w[:, None]], dim=1), rotation[:, 1])
    return torch.cat([joint_pos[:, 1], in_trunk.flatten(1), rate * (joint_pos[:, 2] - joint_pos[:, 0])], dim=1)


def rotation_vector(rotation: torch.Tensor) -> torch.Tensor:
    """Rotation vectors (n, 3) [rad] of matrices (n, 3, 3) with angles below pi."""
    skew = 0.5 * (rotation - rotation.mT)
    axis = torch.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], dim=1)
    sine, cosine = torch.linalg.norm(axis, dim=1), 0.5 * (torch.diagonal(rotation, dim1=1, dim2=2).sum(dim=1) - 1.0)
    return axis * (torch.atan2(sine, cosine) / sine.clamp(min=1e-9))[:, None]


def frame_features(frames: torch.Tensor) -> torch.Tensor:
    """Features of expert frames (n, 37 + 2 a)."""
    joints = (frames.shape[1] - 37) // 2
    parts = torch.split(frames, [3, 4, joints, 12, 3, 3, joints, 12], dim=1)
    _, _, joint_pos, ends_b, lin_vel_b, ang_vel_b, joint_vel, _ = parts
    return torch.cat([joint_pos, ends_b, lin_vel_b, ang_vel_b, joint_vel], dim=1)


def floors(joints: int) -> torch.Tensor:
    """Lower bound of each feature's standard deviation (f,)."""
    sizes = {"joint_pos": joints, "ends": 12, "lin_vel": 3, "ang_vel": 3, "joint_vel": joints}
    return torch.cat([torch.full((size,), FLOORS[name]) for name, size in sizes.items()])


class FeatureNormalizer:
    """Mean and standard deviation of the expert's features, fitted once."""

    def __init__(self, expert: torch.Tensor, min_std: torch.Tensor):
        self.mean = expert.mean(dim=0)
        self.std = torch.maximum(expert.std(dim=0), min_std.to(expert))

    def __call__(self, windows: torch.Tensor) -> torch.Tensor:
        """Normalize windows (n, h, f) and flatten them (n, h f)."""
        return torch.clamp((windows - self.mean) / self.std, -CLIP, CLIP).flatten(1)
