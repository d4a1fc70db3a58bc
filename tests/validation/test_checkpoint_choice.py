"""The checkpoint is chosen by what it does in the sweep: falls first, then error and pushes."""

import dataclasses

import pytest

from pipeline.validation.bars import read_validation
from pipeline.validation.cells import SURVIVING, Cell, command_cells, start_cells
from pipeline.validation.figures import Measured
from pipeline.validation.sweep import SweepResult, best, error_of, swept

COMMANDS = {cell.name: cell for cell in command_cells((0,))}


def row(name, **numbers):
    return Measured(cell=COMMANDS[name], trials=({"fell": 0.0, **numbers},))


def pushes(name, survived, count):
    trial = COMMANDS["vx +0.6"].trials[0]
    cell = Cell(name=name, group="pushes force", figures=SURVIVING, trials=(trial,) * count)
    return Measured(cell=cell, trials=tuple({"fell": float(index >= survived)} for index in range(count)))


def test_an_error_is_of_the_axis_that_is_commanded():
    assert error_of(row("vx +2.0", forward=1.9, lateral=0.5, yaw_rate=1.0)) == pytest.approx(0.1)
    assert error_of(row("vx -0.6", forward=-0.5)) == pytest.approx(0.1)
    assert error_of(row("vy +0.6", forward=9.0, lateral=0.4)) == pytest.approx(0.2)
    assert error_of(row("yaw -1.5", yaw_rate=-1.2)) == pytest.approx(0.3)


def test_a_fall_counts_the_whole_command():
    fallen = Measured(cell=COMMANDS["vx +1.5"], trials=({"fell": 1.0},))
    assert error_of(fallen) == pytest.approx(1.5)


def test_figures_of_a_checkpoint_are_those_of_its_cells(root):
    """Of the commands one takes too much power, one falls, and one is as it should be; a fall at a command that is not
    required counts as an error alone, and one from a perturbed start, where the suite allows some, as a missed bar."""
    bars = read_validation(root / "data/validation.yaml", root / "robots/t1/validation.yaml")
    fallen = Measured(cell=COMMANDS["yaw +1.0"], trials=({"fell": 1.0},))
    step = dataclasses.replace(COMMANDS["vx +2.0"], name="step 0 to 2.0", group="steps")
    steps = Measured(cell=step, trials=({"fell": 1.0},))
    walks = [row("vx +2.0", forward=1.9, power=600.0), row("vx +1.0", forward=1.0, power=200.0), fallen, steps]
    slow = Measured(cell=COMMANDS["vx +0.3"], trials=({"fell": 1.0},))
    start = Measured(cell=start_cells((41,))[0], trials=({"fell": 1.0},))
    rows = [*walks, slow, start, pushes("40", 6, 8), pushes("50", 2, 8)]
    found = swept(700, rows, bars)
    assert (found.iteration, found.falls, found.missed) == (700, 2, 4)
    assert found.command_error == pytest.approx((0.1 + 0.0 + 1.0 + 0.3) / 4)
    assert found.survival == pytest.approx(0.5)
    assert found.score == pytest.approx(10.0 * 2 + 4 + (1.4 / 4) / 0.05 + 2.0 * 0.5)


@pytest.mark.parametrize(
    ("other", "wins"),
    [
        ({"falls": 1, "command_error": 0.01, "survival": 1.0}, 100),
        ({"missed": 1, "command_error": 0.02, "survival": 0.6}, 100),
        ({"missed": 1, "command_error": 0.01, "survival": 0.7}, 200),
        ({"command_error": 0.04, "survival": 0.5}, 200),
        ({"command_error": 0.05, "survival": 0.6}, 200),
        ({"command_error": 0.05, "survival": 0.5}, 200),
        ({"command_error": 0.06, "survival": 0.5}, 100),
    ],
)
def test_the_best_falls_least_then_errs_least_and_the_later_wins_a_tie(other, wins):
    first = SweepResult(iteration=100, falls=0, missed=0, command_error=0.05, survival=0.5)
    second = SweepResult(**{"iteration": 200, "falls": 0, "missed": 0, **other})
    assert best([first, second]).iteration == best([second, first]).iteration == wins
