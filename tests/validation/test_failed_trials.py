"""Failures written as logs, read back by what reads the robot's own."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline.deployment import deployment_task, digest
from pipeline.files import settings
from pipeline.hardware_logs import LogSettings, ingest, layouts, read_trial
from pipeline.robot import Robot
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.bars import Bar, CellBars
from pipeline.validation.deployed import Deployed
from pipeline.validation.failed_trials import failed_trial, file_name, worst_trial, write_failed_trials
from pipeline.validation.measure import measure_trials
from pipeline.validation.push_cells import push_cells
from pipeline.validation.verdict import CellVerdict, Reason, Verdict
from pipeline.validation.walk import Worlds
from tests.factories.policies import still_policy
from tests.factories.validation_walks import cell, measured


@pytest.fixture
def still(robot: Robot) -> Deployed:
    """A robot held in its default pose, which any push topples."""
    task = deployment_task(robot)
    return Deployed(
        robot=robot, task=task, policy=still_policy(task), envelope=TorqueEnvelope(limit=robot.torque_limit)
    )


@pytest.fixture
def verdict(still: Deployed) -> Verdict:
    pushed = next(each for each in push_cells(still.robot, ("force",)) if each.name == "push force standing 60 Ns")
    few = dataclasses.replace(pushed, trials=pushed.trials[2:3])
    numbers = measure_trials(still, few.trials)
    assert numbers[0]["fell"] == 1.0
    bars = CellBars(required=True, why="", bars={"survival": Bar(unit="share", source="test", at_least=0.9)})
    reason = Reason(cell=few.name, figure="survival", got=0.0, bar="at least 0.9 share")
    one = CellVerdict(measured=measured(few, *numbers), bars=bars, reasons=(reason,))
    return Verdict(suite="quick", policy="p", robot="r", cells=(one,))


def test_a_failed_cell_is_a_log_that_the_reader_of_logs_takes(
    root: Path, tmp_path: Path, still: Deployed, verdict: Verdict
):
    (path,) = write_failed_trials(still, verdict, tmp_path)
    assert path.name == "push_force_standing_60_ns.mcap"
    rollout, log = failed_trial(Worlds(still), verdict.cells[0])
    assert log.facts.simulated
    assert log.facts.policy_digest == digest(still.policy)
    assert log.facts.notes["validation cell"] == "push force standing 60 Ns"
    assert [(event.kind, event.time_s) for event in log.facts.events] == [("pushed", 1.0)]
    np.testing.assert_allclose(log.low_state.joint_pos[0], rollout.qpos[0, 7:], atol=0.01)
    first = path.read_bytes()
    bounds = settings.read(root / "data" / "hardware_logs.yaml", LogSettings)
    found = ingest(path, "failure", tmp_path / "trials", layouts=layouts([still.robot]), settings=bounds)
    (trial,) = found.trials
    assert found.integrity == "complete"
    again = read_trial(trial.path)
    assert again.simulated
    assert again.policy_digest == digest(still.policy)
    write_failed_trials(still, verdict, tmp_path)
    assert path.read_bytes() == first


def test_the_worst_trial_is_the_first_that_fell_or_the_farthest_from_its_bar():
    reason = Reason(cell="a", figure="speed_error", got=0.4, bar="at most 0.1 m/s")
    bars = CellBars(required=True, why="", bars={})

    def worst_of(*trials: dict) -> int:
        found = measured(cell("a", 3), *trials)
        return worst_trial(CellVerdict(measured=found, bars=bars, reasons=(reason,))).seed

    assert worst_of({"speed_error": 0.2}, {"speed_error": 0.4}, {"speed_error": 0.3}) == 2
    assert worst_of({"speed_error": 0.2}, {"speed_error": 0.4}, {"fell": 1.0, "fell_s": 2.0}) == 3


def test_file_names_keep_signs_apart():
    assert file_name("vx +0.6") == "vx_plus_0.6"
    assert file_name("vx -0.6") == "vx_minus_0.6"
    assert file_name("push ball standing 1.3 m") == "push_ball_standing_1.3_m"
