"""What grows over a run's iterations, as numbers on the device: a step that is replayed reads them there."""

from __future__ import annotations

import torch

from pipeline.training.options import Options


def grown(span: tuple[float, float], iteration: float, iterations: int) -> float:
    """A value on its way from the first to the last of a span."""
    share = 1.0 if iterations <= 0 else min(1.0, iteration / iterations)
    return span[0] + (span[1] - span[0]) * share


def passed(between: tuple[int, int], iteration: float) -> float:
    """The share of the way from the first to the last of two iterations that lies behind."""
    first, last = between
    return min(1.0, max(0.0, (iteration - first) / max(last - first, 1)))


def grown_between(span: tuple[float, float], between: tuple[int, int], iteration: float) -> float:
    """A value on its way from the first to the last of a span, between two iterations."""
    return span[0] + (span[1] - span[0]) * passed(between, iteration)


class Ramps:
    """Each a tensor of one number, at the value of the iteration that `at` was last called with."""

    def __init__(self, options: Options, device: str):
        self._options = options
        self.penalty = torch.zeros((), device=device)
        """What penalties are multiplied by."""
        self.cost = torch.zeros((), device=device)
        """What the cost of power and saturation is multiplied by besides."""
        self.late = torch.zeros((), device=device)
        """What late rewards are multiplied by."""
        self.push_speed = torch.zeros((), device=device)
        """Largest change of the base's velocity [m/s]."""
        self.push_impulse = torch.zeros((), device=device)
        """Largest impulse of a force on the trunk [N s]."""
        self.assist = torch.zeros((), device=device)
        """Share of the full help that robots are given."""
        self.tracked = torch.zeros((), device=device)
        """Share of the episodes that begin to track a clip."""
        self._known: dict[str, float] = {}
        self.at(0.0)

    def at(self, iteration: float) -> None:
        """Go to an iteration; only what has changed is written."""
        options = self._options
        tracked = (options.tracked, options.tracked_end if options.tracked else 0.0)
        values = {
            "penalty": grown((options.penalty_start, 1.0), iteration, options.penalty_iterations),
            "cost": grown_between((options.cost_start, 1.0), options.cost_iterations, iteration),
            "late": passed(options.late_iterations, iteration),
            "push_speed": grown(options.push_speed, iteration, options.push_iterations),
            "push_impulse": grown(options.push_impulse, iteration, options.push_iterations),
            "tracked": grown_between(tracked, options.tracked_iterations, iteration),
            "assist": grown_between((options.assist, 0.0), options.assist_iterations, iteration),
        }
        for name, value in values.items():
            if self._known.get(name) != value:
                getattr(self, name).fill_(value)
        self._known = values
