"""What the motors' power is beyond what is usual at the command, averaged over about a step.

Power rises and falls within each step, so that the moment's can't be held to a bound. What is averaged is how far it
was over the bound of the command of that time: a new command inherits no debt. Nor does the end of a recovery, in which
effort costs nothing.
"""

from __future__ import annotations

import torch

from pipeline.training.masks import replace
from pipeline.training.pushes import recovery_left
from pipeline.training.readings import MEAN_TIME_S
from pipeline.training.reward_terms import power_share


class PowerExcess:
    """Of N robots; option `power_free` is the bound."""

    def __init__(self, env):
        self._env, self._options = env, env.context.options
        self._over = torch.zeros(env.num_envs, device=env.device)

    @property
    def share(self) -> torch.Tensor:
        """Power beyond the bound (n,), over what is usual at the command and `reward_terms.NOISE_W` more."""
        return self._over.clamp(min=0.0)

    def advance(self) -> None:
        """A control step further, after the readings and before rewards."""
        read = self._env.readings
        over = power_share(read.torque, read.joint_vel, self._env.command, self._options.power_free)
        if self._options.recovery_s:
            over = torch.where(recovery_left(self._env, self._options.recovery_s) > 0.0, 0.0, over)
        self._over += (torch.nan_to_num(over) - self._over) * (self._env.step_dt / MEAN_TIME_S)

    def restart(self, mask: torch.Tensor) -> None:
        """Another episode begins."""
        replace(self._over, mask, 0.0)
