"""Ground that slopes, as gravity that leans: to a robot on a plane it is the same, and costs no more than level ground.

Some environments are sloped, each by an angle and in a direction of its own, which stay; over the iterations the slopes
grow. The world's third axis is the ground's normal; what sensors see, and what counts as upright, is gravity's.
"""

from __future__ import annotations

import math

import torch
import warp as wp

from pipeline.training.ramps import passed

GRAVITY = 9.81
"""[m/s^2]"""
LEVEL_DEG = 0.5
"""Less than this is level ground."""


class Slopes:
    """Gravity of N environments; made before anything reads it."""

    def __init__(self, env):
        options, count, device = env.context.options, env.num_envs, env.device
        self._between, self._share = options.slope_iterations, -1.0
        sloped = torch.rand(count, device=device) < options.slope_share
        self._steepest = math.radians(options.slope_deg) * torch.rand(count, device=device) * sloped
        way = 2.0 * math.pi * torch.rand(count, device=device)
        self._way_w = torch.stack([torch.cos(way), torch.sin(way)], dim=1)
        self.down_w = torch.zeros(count, 3, device=device)
        """Direction of gravity (n, 3), unit."""
        self._gravity_w = torch.zeros(count, 3, device=device)
        self.at(0.0)
        env.sim.wp_model.opt.gravity = wp.from_torch(self._gravity_w, dtype=wp.vec3)
        env.sim.create_graph()  # what was recorded reads the one vector that was there before

    @property
    def level(self) -> torch.Tensor:
        """Whose ground slopes by less than LEVEL_DEG now (n,)."""
        return self.down_w[:, 2] < -math.cos(math.radians(LEVEL_DEG))

    def at(self, iteration: float) -> None:
        """Go to an iteration; only what has changed is written."""
        share = passed(self._between, iteration)
        if share == self._share:
            return
        self._share = share
        lean = share * self._steepest[:, None]
        self.down_w.copy_(torch.cat([torch.sin(lean) * self._way_w, -torch.cos(lean)], dim=1))
        self._gravity_w.copy_(GRAVITY * self.down_w)
