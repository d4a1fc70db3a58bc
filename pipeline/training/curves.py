"""Training metrics, summed over environment steps, which become columns of `curves.csv`.

Columns: iteration; seconds of training so far; steps_per_s; episode_s (mean length of ended episodes); falls_per_min,
stalls_per_min, lost_per_min (tracking failures), all per environment; reward_<term> (weighted mean of each term [1/s];
times the control step they sum to task_reward); for each command bin the commanded and the achieved value on its axis,
from two seconds after a new command on; followed (mean over the bins of achieved / commanded); touchdowns_per_min (at
0.6 to 1.2 m/s); learning_rate. AMP + PPO: task_reward, style_reward (means per step); d_expert, d_policy, accuracy,
gradient_penalty (at updates), d_rollout (on new windows); style_share, disturbance (ramps); update_s; explained
(explained variance of the returns); action_std. Distillation: loss and fit (mean squared action error on visited and on
learned states), teacher_share.
"""

from collections.abc import Mapping, Sequence

import torch

from pipeline.training.mdp.commands import moves
from pipeline.training.mdp.terminations import ended_by, fell

SETTLED_S = 2.0
"""Least age of a command whose velocity counts [s]."""

BINS = {
    "stand": (0, lambda c: ~moves(c)),
    "back": (0, lambda c: c[:, 0] < -0.2),
    "slow": (0, lambda c: (c[:, 0] > 0.2) & (c[:, 0] <= 0.6)),
    "mid": (0, lambda c: (c[:, 0] > 0.6) & (c[:, 0] <= 1.2)),
    "fast": (0, lambda c: (c[:, 0] > 1.2) & (c[:, 0] <= 1.8)),
    "top": (0, lambda c: c[:, 0] > 1.8),
    "side": (1, lambda c: c[:, 1].abs() > 0.2),
    "turn": (2, lambda c: c[:, 2].abs() > 0.3),
}
"""Command bins by name: compared axis, and the predicate of its commands (n, 3)."""


class Record:
    """Sums over steps and environments since the last `take`."""

    def __init__(self, device: str, terms: Sequence[str]):
        """`terms`: reward term names in the manager's order."""
        self._terms = tuple(terms)
        self._rewards = torch.zeros(len(terms), device=device)
        self._velocity = torch.zeros(len(BINS), 3, device=device)
        self._episodes = torch.zeros(6, device=device)
        self._touchdowns = torch.zeros(2, device=device)

    def add(self, env) -> None:
        """Add a step, after it is done."""
        in_mid_bin = BINS["mid"][1](env.command)
        self._touchdowns += torch.stack([(env.robot_state.landed.sum(dim=1) * in_mid_bin).sum(), in_mid_bin.sum()])
        self._rewards += env.reward_manager._step_reward.sum(dim=0)
        done, falls = env.reset_buf, fell(env)
        ends = [falls.sum(), *((ended_by(env, name) & ~falls).sum() for name in ("stalled", "tracking_failed"))]
        lengths = (env.ended_steps * done).sum()
        counts = [done.sum(), lengths, *ends, torch.ones_like(lengths) * len(done)]
        self._episodes += torch.stack([count.float() for count in counts])

    def add_velocity(self, env) -> None:
        """Add commanded and achieved velocities."""
        command, velocity = env.command, env.robot_state.velocity
        settled = env.velocity_command.age > SETTLED_S
        rows = []
        for axis, member in BINS.values():
            inside = (settled & member(command)).float()
            sign = torch.sign(command[:, axis])
            along = torch.where(sign == 0.0, velocity[:, :2].norm(dim=1), sign * velocity[:, axis])
            rows.append(torch.stack([inside.sum(), (inside * command[:, axis].abs()).sum(), (inside * along).sum()]))
        self._velocity += torch.nan_to_num(torch.stack(rows))

    def take(self, step_s: float) -> dict[str, float]:
        """Return the metrics and reset the sums."""
        ended, lengths, falls, stalls, tracking_failures, steps = self._episodes.tolist()
        minutes = max(steps * step_s / 60.0, 1e-9)
        figures = {
            "episode_s": lengths / ended * step_s if ended else float("nan"),
            "falls_per_min": falls / minutes,
            "stalls_per_min": stalls / minutes,
            "lost_per_min": tracking_failures / minutes,
        }
        for name, total in zip(self._terms, self._rewards.tolist(), strict=True):
            figures[f"reward_{name}"] = total / max(steps, 1.0)
        for name, (count, commanded, achieved) in zip(BINS, self._velocity.tolist(), strict=True):
            figures[f"{name}_commanded"] = commanded / count if count else float("nan")
            figures[f"{name}_achieved"] = achieved / count if count else float("nan")
        touchdowns, steps_walked = self._touchdowns.tolist()
        figures["touchdowns_per_min"] = 60.0 * touchdowns / (steps_walked * step_s) if steps_walked else float("nan")
        figures["followed"] = followed(figures)
        for sums in (self._touchdowns, self._velocity, self._episodes, self._rewards):
            sums.zero_()
        return figures


def followed(figures: Mapping[str, float]) -> float:
    """Mean ratio of achieved to commanded, clipped to 0..1, over the bins of moving commands; NaN without any."""
    shares = [
        min(1.0, max(0.0, figures[f"{name}_achieved"] / figures[f"{name}_commanded"]))
        for name in BINS
        if name != "stand" and figures[f"{name}_commanded"] > 0.0
    ]
    return sum(shares) / len(shares) if shares else float("nan")
