"""Pictures of a validation are made of what there is: of suites without pushes, of cells in which everything fell."""

import numpy as np
import pytest

from pipeline.robot import Robot
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.bars import CellBars
from pipeline.validation.cells import command_cells
from pipeline.validation.figures import Measured
from pipeline.validation.suites import push_cells
from pipeline.validation.verdict import CellVerdict, Verdict
from pipeline.viewing.validation_plots import command_tracking, foot_contacts, survival_heatmap, torque_speed
from tests.factories.validation_walks import gliding_rollout

PNG = b"\x89PNG"
FELL = {"fell": 1.0, "fell_s": 1.0}
STOOD = {"fell": 0.0, "forward": 0.5, "lateral": 0.0, "yaw_rate": 0.1}


def _verdict(*cells: Measured) -> Verdict:
    bars = CellBars(required=True, why="", bars={})
    return Verdict(
        suite="full",
        policy="p",
        robot="r",
        cells=tuple(CellVerdict(measured=cell, bars=bars, reasons=()) for cell in cells),
    )


@pytest.mark.parametrize("numbers", [FELL, STOOD])
def test_commands_are_drawn_whether_the_robot_stood_or_fell(numbers: dict):
    cells = [Measured(cell=cell, trials=(numbers,) * 5) for cell in command_cells((1, 2, 3, 4, 5))]
    assert command_tracking(_verdict(*cells)).startswith(PNG)


def test_pushes_are_drawn_and_none_is_a_picture_too(robot: Robot):
    fell = [Measured(cell=cell, trials=(FELL, STOOD) * 32) for cell in push_cells(robot)]
    whole, empty = survival_heatmap(_verdict(*fell)), survival_heatmap(_verdict())
    assert whole.startswith(PNG) and empty.startswith(PNG)
    assert len(whole) > len(empty)


def test_walks_are_drawn_over_their_envelope_with_their_contacts(robot: Robot):
    walks = {
        name: gliding_rollout(robot, (0.5, 0.0, 0.0), torque=float(k), joint_speed=k) for k, name in enumerate("ab")
    }
    falling = TorqueEnvelope(limit=robot.torque_limit, knee_speed=np.full(23, 5.0), no_load_speed=np.full(23, 10.0))
    assert torque_speed(walks, falling).startswith(PNG)
    assert foot_contacts(walks).startswith(PNG)
    assert foot_contacts({"one": walks["a"]}).startswith(PNG)
