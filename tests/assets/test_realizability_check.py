"""The check of `expert_db` warns where a classifier tells the database from the simulation."""

import logging

import dagster as dg
import pytest

from assets import database_checks
from assets.plan import robot_plans
from pipeline.batch import Manifest
from pipeline.expert.realizability import TooFewMotionsError

PLAN = robot_plans("t1")["expert_db"]
CLIPS = Manifest(stage="feasible_motions", entries=(), judged=())


@pytest.mark.parametrize(("accuracy", "passed"), [(0.5, True), (0.75, True), (0.76, False), (1.0, False)])
def test_an_accuracy_above_three_quarters_is_a_warning(monkeypatch, accuracy: float, passed: bool):
    monkeypatch.setattr(database_checks, "measured", lambda *asked: accuracy)
    result, found = database_checks.realizability_check(PLAN, CLIPS, None, logging.getLogger())
    assert (result.passed, result.severity, found) == (passed, dg.AssetCheckSeverity.WARN, accuracy)
    assert f"held-out accuracy {accuracy:.2f}" in str(result.metadata["found"].value)
    declared = {(PLAN.key, name) for name in (*database_checks.BLOCKING, *database_checks.CHECKS)}
    assert (result.asset_key, result.check_name) in declared


def test_a_database_that_cannot_be_measured_says_so(monkeypatch):
    def measured(*asked):
        raise TooFewMotionsError("3 families have motions and rollouts; at least 4 are needed.")

    monkeypatch.setattr(database_checks, "measured", measured)
    result, found = database_checks.realizability_check(PLAN, CLIPS, None, logging.getLogger())
    assert result.passed and found is None
    assert str(result.metadata["found"].value).startswith("not measured: 3 families")
