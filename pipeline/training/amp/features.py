"""Motion features of a frame, computed by one function for the expert and for the policy.

60 numbers for 21 joints: q, hands and feet in the trunk's frame, trunk velocities in its own frame, dq. The
discriminator reads all of them or those of the legs and the trunk.
"""

import torch

from pipeline.learning.robot_facts import RobotFacts

FLOORS = {"joint_pos": 0.1, "ends": 0.05, "lin_vel": 0.2, "ang_vel": 0.3, "joint_vel": 1.0}
"""Least standard deviation [rad, m, m/s, rad/s, rad/s] that features are divided by: features that hardly move in the
data must not outweigh all others."""
COMMAND_FLOOR = 0.2
"""Least standard deviation of a command that the discriminator reads [m/s, rad/s]."""
CLIP = 10.0
"""Normalized features are clipped here."""
LEG_PARTS = ("Hip", "Knee", "Ankle")
"""Parts of the names of leg joints, where the robot has them."""


def features(
    joint_pos: torch.Tensor,
    ends_b: torch.Tensor,
    lin_vel_b: torch.Tensor,
    ang_vel_b: torch.Tensor,
    joint_vel: torch.Tensor,
) -> torch.Tensor:
    """(n, 18 + 2 a) of joints (n, a) in the expert's order and hands and feet (n, 12) in the trunk's frame."""
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
    (n, 3, 3) rotates the root's frame into the world's."""
    ends_b = torch.bmm(ends_pos_w - root_pos_w[:, None], root_rotation_w)
    return features(joint_pos, ends_b.flatten(1), lin_vel_b, ang_vel_b, joint_vel)


def frame_features(frames: torch.Tensor) -> torch.Tensor:
    """Features of expert frames (n, 37 + 2 a)."""
    joints = (frames.shape[1] - 37) // 2
    parts = torch.split(frames, [3, 4, joints, 12, 3, 3, joints, 12], dim=1)
    _, _, joint_pos, ends_b, lin_vel_b, ang_vel_b, joint_vel, _ = parts
    return features(joint_pos, ends_b, lin_vel_b, ang_vel_b, joint_vel)


def chosen_features(kind: str, robot: RobotFacts) -> torch.Tensor:
    """Columns of the features that the discriminator reads: `all`, or `legs`: leg joints, feet and trunk velocities."""
    count = len(robot.controlled)
    if kind == "all":
        return torch.arange(18 + 2 * count)
    legs = torch.tensor([at for at, name in enumerate(robot.controlled) if any(part in name for part in LEG_PARTS)])
    feet = count + torch.arange(6, 12)
    velocities = count + 12 + torch.arange(6)
    return torch.cat([legs.long(), feet, velocities, count + 18 + legs.long()])


def floors(joints: int) -> torch.Tensor:
    """The least standard deviation of each feature."""
    sizes = {"joint_pos": joints, "ends": 12, "lin_vel": 3, "ang_vel": 3, "joint_vel": joints}
    return torch.cat([torch.full((size,), FLOORS[name]) for name, size in sizes.items()])


class FeatureNormalizer:
    """Mean and standard deviation of the expert's features, fitted once."""

    def __init__(self, expert: torch.Tensor, least: torch.Tensor):
        self.mean = expert.mean(dim=0)
        self.std = torch.maximum(expert.std(dim=0), least.to(expert))

    def __call__(self, windows: torch.Tensor) -> torch.Tensor:
        """Windows (n, h, f) normalized and flattened (n, h f)."""
        return torch.clamp((windows - self.mean) / self.std, -CLIP, CLIP).flatten(1)
