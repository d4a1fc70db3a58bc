"""Logs of an earlier verdict in a folder of one's choice: the policy's own go, nothing else is touched."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.errors import FileError
from pipeline.hardware_logs.robot_log import LogFacts, RobotLog
from pipeline.hardware_logs.write import write_mcap
from pipeline.robot import Robot
from pipeline.validation.bars import CellBars
from pipeline.validation.cells import Cell
from pipeline.validation.deployed import Deployed
from pipeline.validation.failed_trials import failed_trial, log_path, refuse_foreign, remove_earlier
from pipeline.validation.suites import named
from pipeline.validation.verdict import CellVerdict
from pipeline.validation.walk import Worlds
from tests.factories.validation_walks import measured

CELL = "push force standing 60 Ns"


@pytest.fixture(scope="module")
def cell(robot: Robot) -> Cell:
    return named(robot, {CELL: 1})[0]


@pytest.fixture(scope="module")
def log(still: Deployed, cell: Cell) -> RobotLog:
    """What the validation writes of a push that topples."""
    numbers = {"fell": 1.0, "fell_s": 1.9}
    bars = CellBars(required=True, why="", bars={})
    return failed_trial(Worlds(still), CellVerdict(measured=measured(cell, numbers), bars=bars, reasons=()))[1]


def without_cell(facts: LogFacts) -> LogFacts:
    return dataclasses.replace(facts, notes={key: text for key, text in facts.notes.items() if "cell" not in key})


FOREIGN: dict[str, Callable[[LogFacts], LogFacts]] = {
    "of the robot itself": lambda facts: dataclasses.replace(facts, simulated=False),
    "of another policy": lambda facts: dataclasses.replace(facts, policy_digest="a" * 64),
    "of no stated policy": lambda facts: dataclasses.replace(facts, policy_digest=None),
    "of another robot": lambda facts: dataclasses.replace(facts, robot="k9"),
    "of another engine": lambda facts: dataclasses.replace(facts, notes={**facts.notes, "engine": "dart"}),
    "of a virtual robot": without_cell,
    "of a cell with another name": lambda facts: dataclasses.replace(facts, notes={"validation cell": "vx +0.6"}),
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_a_log_that_is_not_of_this_policys_validation_is_neither_removed_nor_written_over(
    still: Deployed, cell: Cell, log: RobotLog, tmp_path: Path, kind: str
):
    path = log_path(tmp_path, CELL)
    write_mcap(path, dataclasses.replace(log, facts=FOREIGN[kind](log.facts)))
    before = path.read_bytes()
    assert remove_earlier(tmp_path, still, (), (cell,)) == ()
    with pytest.raises(FileError, match=r"push_force_standing_60_ns.mcap: it is no log of this policy's validation"):
        refuse_foreign(tmp_path, (cell,), still)
    assert path.read_bytes() == before


def test_the_policys_own_log_goes_unless_it_is_of_this_verdict(
    still: Deployed, cell: Cell, log: RobotLog, tmp_path: Path
):
    path = log_path(tmp_path, CELL)
    write_mcap(path, log)
    (tmp_path / "kept by hand.mcap").write_bytes(path.read_bytes())
    (tmp_path / "torn.mcap").write_bytes(path.read_bytes()[:40])
    (tmp_path / "text.mcap").write_text("no log")
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / path.name).write_bytes(path.read_bytes())
    refuse_foreign(tmp_path, (cell,), still)
    assert remove_earlier(tmp_path, still, (path,), (cell,)) == ()
    assert remove_earlier(tmp_path, still, (), ()) == (), "a suite that did not try the cell"
    assert remove_earlier(tmp_path, still, (), (cell,)) == (path,)
    write_mcap(path, log)
    assert remove_earlier(tmp_path, still, ()) == (path,), "a suite that tried all cells"
    left = sorted(str(each.relative_to(tmp_path)) for each in tmp_path.rglob("*.mcap"))
    assert left == [f"below/{path.name}", "kept by hand.mcap", "text.mcap", "torn.mcap"]


def test_a_folder_that_is_a_file_is_refused_before_anything_is_walked(still: Deployed, cell: Cell, tmp_path: Path):
    (tmp_path / "logs").write_text("")
    with pytest.raises(FileError, match="logs: it is no folder"):
        refuse_foreign(tmp_path / "logs", (cell,), still)
    refuse_foreign(tmp_path / "not there yet", (cell,), still)
