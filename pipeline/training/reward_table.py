"""The task reward: the 19 terms of the paper's table with their weights, and what options add to it."""

from __future__ import annotations

import torch
from mjlab.managers.reward_manager import RewardTermCfg

from pipeline.training.added_rewards import following_rows, posture_rows, product_row
from pipeline.training.effort_rewards import effort_rows
from pipeline.training.options import Options
from pipeline.training.paper_rewards import body_rows, feet_rows, tracking_rows
from pipeline.training.pushes import recovery_left
from pipeline.training.reward_row import COST, LATE, PENALTY, Term
from pipeline.training.step_rewards import step_rows


def table(options: Options) -> tuple[Term, ...]:
    """The rows under these options; those of weight 0 are left out. Raises TrainingError for a share that is none."""
    rows = (
        *tracking_rows(options),
        product_row(options),
        *body_rows(options),
        *feet_rows(options),
        *following_rows(options),
        *posture_rows(options),
        *step_rows(options),
        *effort_rows(options),
    )
    return tuple(row for row in rows if row.weight != 0.0)


def reward_cfg() -> dict[str, RewardTermCfg]:
    """The table as one term of mjlab's reward manager, which would launch ten kernels more for each row."""
    return {"task": RewardTermCfg(func=TaskReward, weight=1.0)}


class TaskReward:
    """The weighted sum of the table's rows."""

    def __init__(self, cfg: RewardTermCfg, env):
        self.rows = table(env.context.options)
        self._weights = {
            ramp: torch.tensor([row.weight if row.grows == ramp else 0.0 for row in self.rows], device=env.device)
            for ramp in ("", PENALTY, COST, LATE)
        }
        self._recovery_s = env.context.options.recovery_s
        self._spared = torch.tensor([row.spared for row in self.rows], device=env.device)

    def values(self, env) -> torch.Tensor:
        """Every row's value, not weighted (n, rows)."""
        return torch.stack([row.value(env) for row in self.rows], dim=1)

    def weights(self, env) -> torch.Tensor:
        """Every row's weight at this iteration (rows,)."""
        penalties = self._weights[PENALTY] + env.ramps.cost * self._weights[COST]
        grown = self._weights[""] + env.ramps.penalty * penalties
        return grown + env.ramps.late * self._weights[LATE]

    def __call__(self, env) -> torch.Tensor:
        self.paid = torch.nan_to_num(self.values(env)) * self.weights(env)
        """What every row paid at the last step (n, rows)."""
        if self._recovery_s:
            recovers = recovery_left(env, self._recovery_s)[:, None] > 0.0
            self.paid = torch.where(recovers & self._spared, 0.0, self.paid)
        return self.paid.sum(dim=1)
