"""Velocity commands that a test gives to environments."""

import torch

from pipeline.training.environment import AmpEnvironment


def give_command(env: AmpEnvironment, rows: torch.Tensor, command: torch.Tensor, age_s: float = 0.0) -> None:
    """Set the command of some environments, as if it were `age_s` old."""
    term = env.velocity_command
    for value in (term.command, term.goal):
        value[rows] = command
    term.age[rows] = age_s
