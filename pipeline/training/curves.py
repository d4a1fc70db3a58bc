"""What is kept of a run's progress: figures of the environment, and `curves.csv`, a row an iteration.

Columns: iteration; seconds of training so far; steps_per_s; task_reward, style_reward (means a step); d_expert,
d_policy (at the discriminator's updates), d_rollout (on the fresh windows), gradient_penalty; episode_s (mean length
of ended episodes), falls_per_min, stalls_per_min, strays_per_min (each environment); for each bin of commands the
commanded and the achieved value on its axis, two seconds after the command at the earliest; followed (mean over these
bins of achieved by commanded), style_share (of the style reward in the blend); mid_steps_per_min (at commands of that
bin); learning_rate, update_s (of the networks), explained (share of the variance of the returns that the critic had
foreseen), kept (loss of straying from the walk that is kept), action_std.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch

from pipeline.training.reward_terms import told_to_move

SETTLED_S = 2.0
"""A command is this old before its velocity counts."""

BINS = {
    "stand": (0, lambda c: ~told_to_move(c)),
    "back": (0, lambda c: c[:, 0] < -0.2),
    "slow": (0, lambda c: (c[:, 0] > 0.2) & (c[:, 0] <= 0.6)),
    "mid": (0, lambda c: (c[:, 0] > 0.6) & (c[:, 0] <= 1.2)),
    "fast": (0, lambda c: (c[:, 0] > 1.2) & (c[:, 0] <= 1.8)),
    "top": (0, lambda c: c[:, 0] > 1.8),
    "side": (1, lambda c: c[:, 1].abs() > 0.2),
    "turn": (2, lambda c: c[:, 2].abs() > 0.3),
}
"""Name of a bin: the axis that is compared and which commands (n, 3) are in it."""


class Record:
    """Sums over steps and environments since they were last taken."""

    def __init__(self, device: str):
        self._velocity = torch.zeros(len(BINS), 3, device=device)
        self._episodes = torch.zeros(6, device=device)
        self._steps = torch.zeros(2, device=device)

    def add(self, env) -> None:
        """A step of the environment, after it."""
        walks = BINS["mid"][1](env.command)
        stepped = (env.readings.step_s > 0.0) & walks
        self._steps += torch.stack([stepped.sum(), walks.sum()])
        done = env.reset_buf
        fell, stalled = done & env.fell, done & env.stalled & ~env.fell
        strayed = torch.zeros_like(done) if env.tracked_clip is None else done & env.tracked_clip.strayed & ~env.fell
        lengths = (env.ended_steps * done).sum()
        ends = [each.sum() for each in (fell, stalled, strayed)]
        counts = [done.sum(), lengths, *ends, torch.ones_like(lengths) * len(done)]
        self._episodes += torch.stack([count.float() for count in counts])

    def add_velocity(self, env) -> None:
        """How fast robots are now, held against their commands."""
        command, velocity = env.command, env.readings.velocity
        settled = env.velocity_command.age > SETTLED_S
        rows = []
        for axis, member in BINS.values():
            inside = (settled & member(command)).float()
            sign = torch.sign(command[:, axis])
            along = torch.where(sign == 0.0, velocity[:, :2].norm(dim=1), sign * velocity[:, axis])
            rows.append(torch.stack([inside.sum(), (inside * command[:, axis].abs()).sum(), (inside * along).sum()]))
        self._velocity += torch.nan_to_num(torch.stack(rows))

    def take(self, step_s: float) -> dict[str, float]:
        """The figures, and the sums start anew."""
        ended, lengths, falls, stalls, strays, steps = self._episodes.tolist()
        minutes = max(steps * step_s / 60.0, 1e-9)
        figures = {
            "episode_s": lengths / ended * step_s if ended else float("nan"),
            "falls_per_min": falls / minutes,
            "stalls_per_min": stalls / minutes,
            "strays_per_min": strays / minutes,
        }
        for name, (count, commanded, achieved) in zip(BINS, self._velocity.tolist(), strict=True):
            figures[f"{name}_commanded"] = commanded / count if count else float("nan")
            figures[f"{name}_achieved"] = achieved / count if count else float("nan")
        stepped, walked = self._steps.tolist()
        figures["mid_steps_per_min"] = 60.0 * stepped / (walked * step_s) if walked else float("nan")
        self._steps.zero_()
        self._velocity.zero_()
        self._episodes.zero_()
        return figures


def followed(figures: Mapping[str, float]) -> float | None:
    """Mean over the bins of moving commands of what is achieved of the commanded, each 0..1; None without any."""
    shares = [
        min(1.0, max(0.0, figures[f"{name}_achieved"] / figures[f"{name}_commanded"]))
        for name in BINS
        if name != "stand" and figures[f"{name}_commanded"] > 0.0
    ]
    return sum(shares) / len(shares) if shares else None
