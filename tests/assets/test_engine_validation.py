"""What the assets of other engines store: a missing Webots is told as not run, and no stand-in as Webots."""

from __future__ import annotations

from typing import Any

import pytest

from assets.webots import stored_verdict
from pipeline.release.dossier import Status, judged
from pipeline.webots.validate import MUJOCO_STAND_IN, ODE_STAND_IN, WEBOTS, WebotsVerdict


def stored(status: str, reasons: tuple[str, ...] = ()) -> dict[str, Any]:
    verdicts = {
        WEBOTS: WebotsVerdict(engine=WEBOTS, status=status, reasons=reasons),
        MUJOCO_STAND_IN: WebotsVerdict(engine=MUJOCO_STAND_IN, status="passed"),
        ODE_STAND_IN: WebotsVerdict(engine=ODE_STAND_IN, status="not run: ode not found"),
    }
    return stored_verdict("webots_validation", "d1", verdicts, WEBOTS)


@pytest.mark.parametrize(
    "status", ["not run: webots not found", "timed out: it was ended after 300 s", "garbage: the result is empty"]
)
def test_what_webots_did_not_judge_is_not_run_though_a_stand_in_passed(status: str):
    said = stored(status)
    assert said["passed"] is None
    assert said["not_run"] == [status]
    page = judged("webots_validation", said, "d1")
    assert page.status is Status.NOT_RUN
    assert status in page.reasons


def test_a_pass_in_webots_is_one_and_a_failure_has_its_reasons():
    assert judged("webots_validation", stored("passed"), "d1").status is Status.PASSED
    failed = judged("webots_validation", stored("failed", ("fell after 3.00 s",)), "d1")
    assert failed.status is Status.FAILED
    assert failed.reasons == ("fell after 3.00 s",)


def test_stand_ins_stand_by_their_own_names():
    said = stored("passed")
    assert said["webots"]["engine"] == "Webots"
    assert {name: each["engine"] for name, each in said["stand_ins"].items()} == {
        MUJOCO_STAND_IN: "MuJoCo (stand-in, not Webots)",
        ODE_STAND_IN: "ODE (Webots' engine family, upstream; stand-in, not Webots)",
    }
    facts = dict(judged("webots_validation", said, "d1").facts)
    assert facts[MUJOCO_STAND_IN] == "passed"
    assert facts[ODE_STAND_IN] == "not run: ode not found"
