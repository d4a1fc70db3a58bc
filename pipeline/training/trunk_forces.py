"""Forces and moments on the trunk: pushes, and a helping hand that holds robots up while they learn and then lets go.

The hand is a spring and damper that keeps the trunk upright and a damper that pulls its velocity to the command; both
fade over a run. Held so, a robot stays near a clip by little more than the clip's joints, and learns to keep upright as
the hand lets go; alone it does not make steps longer. A helped curriculum is that of Yu, Turk and Liu, "Learning
Symmetric and Low-Energy Locomotion", ACM ToG 37(4), 2018.
"""

from __future__ import annotations

import torch

from pipeline.training.masks import replace

MOMENT = 200.0
"""Of the hand's spring, for each sine of the trunk's tilt [N m]: a robot that leans as a whole needs about as much."""
MOMENT_DAMPING = 10.0
"""[N m s/rad]; the trunk's own inertia of .09 kg m^2 bears no more at a physics step of 5 ms."""
FORCE_DAMPING = 100.0
"""Of the horizontal velocity that lacks of the command [N s/m]: a robot of 32 kg follows within .3 s."""


def helping_wrench(
    up_b: torch.Tensor,
    rotation_w: torch.Tensor,
    ang_vel_b: torch.Tensor,
    heading_w: torch.Tensor,
    velocity: torch.Tensor,
    command: torch.Tensor,
) -> tuple[torch.Tensor, torch.Tensor]:
    """Force [N] and moment [N m] of the hand, in the world (n, 3).

    `up_b` (n, 3): the vertical in the trunk's frame, which `rotation_w` (n, 3, 3) turns into the world's; `ang_vel_b`
    (n, 3) [rad/s]; `heading_w` (n, 2) as (cos, sin); `velocity` and `command` (n, 3): forward, lateral [m/s], yaw rate
    [rad/s], the first two in the frame of the heading.
    """
    lacks = FORCE_DAMPING * (command[:, :2] - velocity[:, :2])
    cos, sin = heading_w.unbind(dim=1)
    force = torch.stack(
        [lacks[:, 0] * cos - lacks[:, 1] * sin, lacks[:, 0] * sin + lacks[:, 1] * cos, torch.zeros_like(cos)], dim=1
    )
    wanted_b = up_b * command[:, 2:]
    axis_b = torch.stack([-up_b[:, 1], up_b[:, 0], torch.zeros_like(cos)], dim=1)  # z x up
    moment_b = MOMENT * axis_b + MOMENT_DAMPING * (wanted_b - ang_vel_b)
    return force, torch.bmm(rotation_w, moment_b[..., None])[..., 0]


class TrunkForces:
    """What acts on the trunk of each environment."""

    def __init__(self, env):
        self._env, self._robot = env, env.scene["robot"]
        (trunk,), _ = self._robot.find_bodies(env.context.bundle.robot.root_link)
        self._trunk = slice(trunk, trunk + 1)  # a list of indices would be copied to the GPU at each step
        self.helps = env.context.options.assist > 0.0
        """Whether there is a hand, which has to follow at every physics step."""
        self.push_w = torch.zeros(env.num_envs, 3, device=env.device)
        """Pushes (n, 3) [N]; none at the start of an episode."""
        self._none = torch.zeros_like(self.push_w)
        env.restarts.append(lambda mask: replace(self.push_w, mask, 0.0))

    def write(self) -> None:
        """Bring them into the simulation; also those that are none: to count them, a processor would have to wait."""
        force, moment = self.push_w, self._none
        if self.helps:
            env, read = self._env, self._env.readings
            read.fresh()
            pull, moment = helping_wrench(
                -read.gravity_b, read.root_rotation_w, read.ang_vel_b, read.heading_w, read.velocity, env.command
            )
            force, moment = force + env.ramps.assist * pull, env.ramps.assist * moment
        self._robot.write_external_wrench_to_sim(force[:, None], moment[:, None], body_ids=self._trunk)
