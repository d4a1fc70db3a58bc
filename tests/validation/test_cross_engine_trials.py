"""A fall in an engine as the log of a robot: read back by the reader of real logs."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline.batch import ClipPool
from pipeline.deployment import deployment_task
from pipeline.files.settings import read
from pipeline.hardware_logs.missed_bars import MissedBar, trusted_bars
from pipeline.robot import Robot
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.bars import Bar, CellBars, ValidationSettings, read_validation
from pipeline.validation.cross_engine import CellResult, CrossEngineResult, cross_engine
from pipeline.validation.cross_engine_trials import failure_log, first_failures, missed_by, write_failures
from pipeline.validation.cross_engine_walk import DART, MUJOCO, Cell, CrossEngineSettings, Figures, Segment
from pipeline.validation.deployed import Deployed
from tests.factories.policies import still_policy


@pytest.fixture(scope="module")
def limp(robot: Robot) -> Deployed:
    """Motors without strength: it falls in any engine."""
    task = deployment_task(robot)
    return Deployed(
        robot=robot, task=task, policy=still_policy(task), envelope=TorqueEnvelope(limit=0.01 * robot.torque_limit)
    )


@pytest.fixture(scope="module")
def settings(root: Path) -> CrossEngineSettings:
    """Standing for a second and a half, twice."""
    whole = read(root / "data" / "cross_engine.yaml", CrossEngineSettings)
    cell = Cell(segments=(Segment(seconds=1.5, command=(0.0, 0.0, 0.0)),), measured_s=0.5)
    cells = {"stand": cell, "stand_too": cell}
    return dataclasses.replace(whole, simulation=dataclasses.replace(whole.simulation, seeds=2), cells=cells)


@pytest.fixture(scope="module")
def rules(root: Path) -> ValidationSettings:
    """The first is required, the second not."""
    whole = read_validation(root / "data/validation.yaml", root / "robots/t1/validation.yaml")
    spared = CellBars(required=False, why="test", bars={})
    return dataclasses.replace(whole, engines={"stand": whole.engines["stand"], "stand_too": spared})


@pytest.fixture(scope="module")
def found(limp: Deployed, settings: CrossEngineSettings, rules: ValidationSettings) -> CrossEngineResult:
    return cross_engine(limp, settings, rules, engines=(MUJOCO, DART))


def test_parallel_processes_find_the_same_bits(
    limp: Deployed, settings: CrossEngineSettings, rules: ValidationSettings, found: CrossEngineResult
):
    spread = cross_engine(limp, settings, rules, engines=(MUJOCO, DART), pool=ClipPool(workers=2))
    assert spread.to_dict() == found.to_dict()


def test_each_engine_leaves_its_first_fall_of_a_required_cell(
    tmp_path: Path, limp: Deployed, settings: CrossEngineSettings, found: CrossEngineResult
):
    assert first_failures(found.cells[0], settings.cells["stand"]) == ((MUJOCO, 0), (DART, 0))
    logs = write_failures(limp, found, settings, tmp_path)
    assert [path.name for path in logs] == ["stand_mujoco.mcap", "stand_dart.mcap"]
    again = write_failures(limp, found, settings, tmp_path / "again")
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in logs]


def test_where_none_falls_the_first_walk_off_its_command_is_written():
    """A fall comes first, wherever it is; what only another engine does otherwise is no trial."""

    def walked(forward: float, fell_s: float | None = None) -> Figures:
        return Figures(
            fell_s=fell_s, forward_m_s=forward, lateral_m_s=0.0, yaw_rate_rad_s=0.0, height_m=0.67, power_w=1.0
        )

    said = Cell(segments=(Segment(seconds=1.0, command=(0.6, 0.0, 0.0)),), measured_s=0.5)
    bars = CellBars(required=True, why="", bars={"speed_error": Bar(unit="m/s", source="test", at_most=0.1)})
    good, slow, fell = walked(0.6), walked(0.2), walked(float("nan"), fell_s=0.4)

    def failures(mujoco: tuple[Figures, ...], dart: tuple[Figures, ...]) -> tuple[tuple[str, int], ...]:
        figures = {"mujoco": mujoco, "bridge": (slow, slow), "dart": dart}
        return first_failures(CellResult(name="walk", bars=bars, figures=figures, reasons=("r",)), said)

    assert failures((good, slow), (good, good)) == ((MUJOCO, 1),)
    assert failures((slow, fell), (good, slow)) == ((MUJOCO, 1), (DART, 1))
    assert failures((good, good), (good, good)) == ()

    bars = CellBars(required=True, why="", bars={**bars.bars, "falls": Bar(unit="trials", source="test", at_most=0.0)})
    cell = CellResult(name="walk", bars=bars, figures={MUJOCO: (good, slow), DART: (fell, slow)}, reasons=("r",))
    span = {"from_s": 0.5, "until_s": 1.0, "axis": "forward", "commanded": 0.6, "achieved": 0.2}
    off = MissedBar(cell="walk", figure="speed_error", got=0.6 - 0.2, asked=0.1, **span)
    assert missed_by(cell, MUJOCO, 0, said) == ()
    assert missed_by(cell, MUJOCO, 1, said) == (off,)
    down = MissedBar(cell="walk", figure="falls", got=1.0, asked=0.0, from_s=0.4, until_s=0.4)
    assert missed_by(cell, DART, 0, said) == (down,)


def test_a_log_holds_the_fall_to_its_end(
    tmp_path: Path, limp: Deployed, settings: CrossEngineSettings, found: CrossEngineResult
):
    log = failure_log(limp, found.cells[0], DART, 0, settings)
    assert log.facts.notes["engine"] == DART
    assert log.facts.notes["validation cell"] == "stand"
    assert "fell after" in log.facts.notes["reasons"]
    assert log.facts.simulated
    ((down,), doubts) = trusted_bars(log.facts, limp.robot.joint_names)
    assert (down.figure, down.got, down.asked, doubts) == ("falls", 2.0, 0.0, ()) and down.from_s < 1.5
    assert np.isfinite(log.low_state.joint_pos).all() and np.isfinite(log.low_state.acc_b).all()
    assert np.ptp(log.low_state.time_ns) * 1e-9 == pytest.approx(1.5, abs=0.1)
    assert np.abs(log.low_state.rpy[-1, :2]).max() > 0.3  # it lies, or is on its way
