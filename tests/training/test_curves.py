"""Figures of a training run: the velocity along its command, of commands that are old enough."""

from types import SimpleNamespace

import pytest
import torch

from pipeline.training.curves import Record

STEP_S = 0.02


def figures(command: list[list[float]], velocity: list[list[float]], age_s: list[float]) -> dict[str, float]:
    """Figures of one step of robots with a command and a velocity each."""
    record = Record("cpu", ())
    env = SimpleNamespace(
        command=torch.tensor(command),
        robot_state=SimpleNamespace(velocity=torch.tensor(velocity)),
        velocity_command=SimpleNamespace(age=torch.tensor(age_s)),
    )
    record.add_velocity(env)
    return record.take(STEP_S)


@pytest.mark.parametrize(
    ("name", "command"),
    [("back", [-0.5, 0.0, 0.0]), ("mid", [1.0, 0.0, 0.0]), ("side", [0.0, -0.4, 0.0]), ("turn", [0.0, 0.0, -1.0])],
)
def test_motion_as_commanded_is_achieved_in_either_direction(name, command):
    size = max(abs(value) for value in command)
    followed = figures([command], [command], [5.0])
    assert followed[f"{name}_achieved"] == followed[f"{name}_commanded"] == pytest.approx(size)
    opposite = figures([command], [[-value for value in command]], [5.0])
    assert opposite[f"{name}_achieved"] == pytest.approx(-size) and opposite["followed"] == 0.0


def test_a_velocity_counts_from_two_seconds_after_the_command():
    ages = figures([[1.0, 0.0, 0.0]] * 3, [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.8, 0.0, 0.0]], [0.5, 1.9, 2.1])
    assert ages["mid_achieved"] == pytest.approx(0.8)
