"""The check of `expert_db` warns where a classifier tells the database from the simulation."""

import logging
from pathlib import Path

import dagster as dg
import pytest

from assets import database_checks
from assets.plan import robot_plans
from pipeline.batch import Manifest
from pipeline.errors import FileError
from pipeline.expert.realizability import TooFewMotionsError

PLAN = robot_plans("t1")["expert_db"]
CLIPS = Manifest(stage="feasible_motions", entries=(), judged=())


@pytest.mark.parametrize(("accuracy", "passed"), [(0.5, True), (0.75, True), (0.76, False), (1.0, False)])
def test_an_accuracy_above_three_quarters_is_a_warning(monkeypatch, accuracy: float, passed: bool):
    monkeypatch.setattr(database_checks, "held_out_accuracy", lambda *asked: accuracy)
    result, found = database_checks.realizability_check(PLAN, CLIPS, None, logging.getLogger())
    assert (result.passed, result.severity, found) == (passed, dg.AssetCheckSeverity.WARN, accuracy)
    assert f"held-out accuracy {accuracy:.2f}" in str(result.metadata["found"].value)
    declared = {(PLAN.key, name) for name in (*database_checks.BLOCKING, *database_checks.CHECKS)}
    assert (result.asset_key, result.check_name) in declared


@pytest.mark.parametrize(
    ("error", "passed"),
    [
        (TooFewMotionsError("3 families have motions and rollouts; at least 4 are needed."), True),
        (database_checks.NoTrackerError("there is no tracker of 't1'."), True),
        (FileError(Path("tracker.npz"), "is damaged.", "Train it again."), False),
    ],
)
def test_a_database_that_cannot_be_measured_says_so(monkeypatch, error: Exception, passed: bool):
    def measured(*asked):
        raise error

    monkeypatch.setattr(database_checks, "held_out_accuracy", measured)
    result, found = database_checks.realizability_check(PLAN, CLIPS, None, logging.getLogger())
    assert result.passed == passed and found is None
    assert str(result.metadata["found"].value) == f"not measured: {error}"
