"""The policy's action: joint targets q_default + 0.25 a; the other joints keep their default position.

Targets are delayed by some physics steps, drawn for each episode up to a maximum that grows with the disturbance
ramp.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from mjlab.managers.action_manager import ActionTerm, ActionTermCfg

from pipeline.training.masks import replace

SCALE = 0.25
"""Joint target per unit of action [rad]."""


@dataclass(kw_only=True)
class PolicyActionCfg(ActionTermCfg):
    """Configuration of `PolicyAction`."""

    delay_s: float
    """Largest delay, at most two control steps [s]."""

    def build(self, env) -> PolicyAction:
        return PolicyAction(self, env)


class PolicyAction(ActionTerm):
    """Convert actions (n, a) in the network's order to position targets of all joints in the robot's order."""

    cfg: PolicyActionCfg

    def __init__(self, cfg: PolicyActionCfg, env):
        super().__init__(cfg, env)
        self._index = env.policy_index
        self._raw = torch.zeros(self.num_envs, len(self._index), device=self.device)
        self._target = env.default_joint_pos.repeat(self.num_envs, 1)
        self._before, self._earlier = self._target.clone(), self._target.clone()
        self._period = env.cfg.decimation
        self._max_lag = round(cfg.delay_s / env.physics_dt)
        self._lag = torch.zeros(self.num_envs, 1, dtype=torch.long, device=self.device)
        self._substep = 0
        env.restarts.append(self.restart)

    @property
    def action_dim(self) -> int:
        return len(self._index)

    @property
    def raw_action(self) -> torch.Tensor:
        return self._raw

    def process_actions(self, actions: torch.Tensor) -> None:
        self._raw[:] = actions
        self._earlier.copy_(self._before)
        self._before.copy_(self._target)
        self._substep = 0
        self._target[:, self._index] = self._env.default_joint_pos[self._index] + SCALE * actions

    def apply_actions(self) -> None:
        """Write the newest target that has arrived, at each physics step."""
        target = self._target
        for delay, older in ((self._substep, self._before), (self._substep + self._period, self._earlier)):
            if delay < self._max_lag:
                target = torch.where(self._lag > delay, older, target)
        self._entity.set_joint_position_target(target)
        self._substep += 1

    def restart(self, mask: torch.Tensor) -> None:
        """Reset the targets of environments in `mask` (n,) to the default pose, and draw their delays."""
        replace(self._raw, mask, 0.0)
        for target in (self._target, self._before):
            replace(target, mask, self._env.default_joint_pos)
        if self._max_lag:
            bound = self._env.disturbance * self._max_lag + 1.0
            drawn = (torch.rand(self._lag.shape, device=self.device) * bound).long()
            replace(self._lag, mask, drawn.clamp(max=self._max_lag))
