"""What the assets of other engines store: a missing Webots is not run, a broken one failed to run."""

from __future__ import annotations

from typing import Any

import dagster as dg
import pytest

from assets.plan import robot_plans
from assets.validation import _webots_checks, stored_verdict
from pipeline.release.dossier import Dossier, Status, verdict_of
from pipeline.webots.validate import MUJOCO_STAND_IN, ODE_STAND_IN, WEBOTS, WebotsVerdict


def stored(status: str, reasons: tuple[str, ...] = ()) -> dict[str, Any]:
    verdicts = {
        WEBOTS: WebotsVerdict(engine=WEBOTS, status=status, reasons=reasons),
        MUJOCO_STAND_IN: WebotsVerdict(engine=MUJOCO_STAND_IN, status="passed"),
        ODE_STAND_IN: WebotsVerdict(engine=ODE_STAND_IN, status="not run: ode not found"),
    }
    return stored_verdict("webots_validation", "d1", verdicts)


def test_a_missing_webots_is_not_run_though_a_stand_in_passed():
    said = stored("not run: webots not found")
    assert (said["passed"], said["not_run"], said["failed_to_run"]) == (None, ["not run: webots not found"], [])
    page = verdict_of("webots_validation", said, "d1")
    assert page.status is Status.NOT_RUN
    assert page.reasons == ("not run: webots not found",)


@pytest.mark.parametrize(
    "status",
    [
        "failed to run: did not start, /opt/webots: Permission denied",
        "failed to run: timed out, it was terminated after 300 s",
        "failed to run: crashed, it was killed by SIGSEGV",
        "failed to run: garbage, the result is empty",
    ],
)
def test_a_webots_that_breaks_is_neither_missing_nor_a_verdict(status: str):
    said = stored(status)
    assert (said["passed"], said["not_run"], said["failed_to_run"]) == (None, [], [status])
    found = verdict_of("webots_validation", said, "d1")
    assert found.status is Status.FAILED_TO_RUN
    dossier = Dossier(title="t", policy="d1", card=(), lineage=(), verdicts=(found,))
    assert dossier.open_points == (f"webots_validation: {status}",)


def test_a_stand_in_that_breaks_is_told_beside_the_verdict_of_webots():
    verdicts = {
        WEBOTS: WebotsVerdict(engine=WEBOTS, status="passed"),
        MUJOCO_STAND_IN: WebotsVerdict(
            engine=MUJOCO_STAND_IN, status="failed to run: crashed, it was killed by SIGABRT"
        ),
    }
    found = verdict_of("webots_validation", stored_verdict("webots_validation", "d1", verdicts), "d1")
    assert found.status is Status.PASSED
    assert found.failed_to_run == ("mujoco stand-in: failed to run: crashed, it was killed by SIGABRT",)


@pytest.mark.parametrize(
    ("status", "severity"),
    [
        ("failed to run: crashed, it was killed by SIGSEGV", dg.AssetCheckSeverity.ERROR),
        ("not run: webots not found", dg.AssetCheckSeverity.WARN),
        ("failed", dg.AssetCheckSeverity.WARN),
    ],
)
def test_the_check_of_a_webots_that_breaks_is_an_error(status: str, severity: dg.AssetCheckSeverity):
    _, walks = _webots_checks(robot_plans("t1")["webots_validation"], (), WebotsVerdict(engine=WEBOTS, status=status))
    assert (walks.passed, walks.severity) == (False, severity)


def test_a_pass_in_webots_is_one_and_a_failure_has_its_reasons():
    assert verdict_of("webots_validation", stored("passed"), "d1").status is Status.PASSED
    failed = verdict_of("webots_validation", stored("failed", ("fell after 3.00 s",)), "d1")
    assert failed.status is Status.FAILED
    assert failed.reasons == ("fell after 3.00 s",)


def test_stand_ins_stand_by_their_own_names():
    said = stored("passed")
    assert said["webots"]["engine"] == "Webots"
    assert {name: each["engine"] for name, each in said["stand_ins"].items()} == {
        MUJOCO_STAND_IN: "MuJoCo (stand-in, not Webots)",
        ODE_STAND_IN: "ODE (Webots' engine family, upstream; stand-in, not Webots)",
    }
    facts = dict(verdict_of("webots_validation", said, "d1").facts)
    assert facts[MUJOCO_STAND_IN] == "passed"
    assert facts[ODE_STAND_IN] == "not run: ode not found"
