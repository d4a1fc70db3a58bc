"""What the discriminator sees of a frame, worked out by one function for the expert and for the policy.

60 numbers for 21 joints: q, hands and feet in the trunk's frame, trunk velocities in its own frame, dq. The option
`discriminator_command` puts the command after them.
"""

from __future__ import annotations

import torch

from pipeline.training.options import Options

FLOORS = {"joint_pos": 0.1, "ends": 0.05, "lin_vel": 0.2, "ang_vel": 0.3, "joint_vel": 1.0, "command": 0.3}
"""Least standard deviation [rad, m, m/s, rad/s, rad/s, m/s and rad/s] that features are divided by: what hardly moves
in the data must not outweigh all else."""

CLIP = 10.0
"""Normalized features are cut here."""


def features(
    joint_pos: torch.Tensor,
    ends_b: torch.Tensor,
    lin_vel_b: torch.Tensor,
    ang_vel_b: torch.Tensor,
    joint_vel: torch.Tensor,
) -> torch.Tensor:
    """(n, 18 + 2 a + …) of joints (n, a) in the expert's order and end effectors (n, 12) in the trunk's frame."""
    return torch.cat([joint_pos, ends_b, lin_vel_b, ang_vel_b, joint_vel], dim=1)


def state_features(
    root_pos_w: torch.Tensor,
    root_rotation_w: torch.Tensor,
    lin_vel_b: torch.Tensor,
    ang_vel_b: torch.Tensor,
    joint_pos: torch.Tensor,
    joint_vel: torch.Tensor,
    ends_pos_w: torch.Tensor,
) -> torch.Tensor:
    """Features of simulator states; `ends_pos_w` (n, 4, 3) are hands and feet in the world, `root_rotation_w`
    (n, 3, 3) turns the root's frame into the world's."""
    ends_b = torch.bmm(ends_pos_w - root_pos_w[:, None], root_rotation_w)
    return features(joint_pos, ends_b.flatten(1), lin_vel_b, ang_vel_b, joint_vel)


def frame_features(frames: torch.Tensor) -> torch.Tensor:
    """Features of expert frames (n, 37 + 2 a)."""
    joints = (frames.shape[1] - 37) // 2
    parts = torch.split(frames, [3, 4, joints, 12, 3, 3, joints, 12], dim=1)
    _, _, joint_pos, ends_b, lin_vel_b, ang_vel_b, joint_vel, _ = parts
    return features(joint_pos, ends_b, lin_vel_b, ang_vel_b, joint_vel)


def up_b(quat: torch.Tensor) -> torch.Tensor:
    """The vertical (t, 3) in the frames of unit quaternions (t, 4), w first."""
    w, x, y, z = quat.unbind(dim=1)
    return torch.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)], dim=1)


def floors(joints: int, command: bool = False, **least: float) -> torch.Tensor:
    """The least standard deviation of each feature; `least` has those that differ from FLOORS."""
    if unknown := least.keys() - FLOORS.keys():
        raise KeyError(f"no feature is called {', '.join(sorted(unknown))}")
    sizes = {"joint_pos": joints, "ends": 12, "lin_vel": 3, "ang_vel": 3, "joint_vel": joints}
    sizes |= {"command": 3} if command else {}
    known = FLOORS | least
    return torch.cat([torch.full((size,), known[name]) for name, size in sizes.items()])


def window_span(options: Options) -> int:
    """Control steps that a window is over."""
    return (options.window - 1) * options.window_stride + (options.window_stride if options.window_means else 1)


def window_frames(steps: torch.Tensor, options: Options) -> torch.Tensor:
    """The frames (n, h, f) that the discriminator sees of `window_span` control steps (n, s, f)."""
    if options.window_means:
        return steps.unflatten(1, (options.window, options.window_stride)).mean(dim=2)
    return steps[:, :: options.window_stride]


class FeatureNormalizer:
    """Mean and standard deviation of the expert's features, fitted once."""

    def __init__(self, expert: torch.Tensor, joints: int, **least: float):
        self.mean = expert.mean(dim=0)
        command = expert.shape[1] > 18 + 2 * joints
        self.std = torch.maximum(expert.std(dim=0), floors(joints, command, **least).to(expert))

    def __call__(self, windows: torch.Tensor) -> torch.Tensor:
        """Windows (n, h, f) as the discriminator takes them (n, h f)."""
        return torch.clamp((windows - self.mean) / self.std, -CLIP, CLIP).flatten(1)
