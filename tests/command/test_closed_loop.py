"""A log is dropped; what failed in it changes the next database, when a person approves. One checkout, one story."""

import json
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import dagster as dg
import numpy as np
import pandas as pd
import pytest

from pipeline.actuators.adapted_robot import read_actuators
from pipeline.batch import Store
from pipeline.feasibility import CommandSettings
from pipeline.feedback.approve import approve_proposal
from pipeline.feedback.cell_weights import cell_parts
from pipeline.files import digest, settings
from pipeline.hardware_logs.log_folder import QUIET_S
from pipeline.project import Project
from tests.factories.checkout import PATIENCE_S, Checkout
from tests.factories.daemon_records import ProcessorTime, runs_of, ticks_of
from tests.factories.feedback_project import propose_into
from tests.factories.trial_reports import report, saturated
from tests.factories.web_ui import WebUi, web_ui

pytestmark = pytest.mark.command

CELL = "0.0 m/s, 0.4 m/s, 0.0 rad/s"
LOG = "side_left_fall"
ROLLED_OUT = ("motion_variants", "reference_motions", "augmented_motions")
"""Stages in which each variant is worked on before KP5 judges its rollouts."""
EVERY_S = 5.0
"""Between ticks of the sensors in this checkout; as shipped it is half a minute."""
INGEST_S = 25.0
"""Most processor time of the run that ingests a log, its start included: with a tick every 30 s and the 3 s that a file
has to be quiet for, that is within a minute."""
KILLS = """    trap = PROJECT.data / "die_here"
    if trap.exists():
        trap.unlink()
        __import__("os").kill(__import__("os").getpid(), 9)
"""


@pytest.fixture(scope="module")
def checkout(root, tmp_path_factory) -> Checkout:
    """A checkout with a database, without logs and approvals, be they of whoever runs this.

    Its runs can be made to die right before the database is written, and its sensors look more often.
    """
    made = Checkout.make(root, tmp_path_factory.mktemp("loop"), ("stand", "side_left")).with_answers_of(root)
    logs = made.root / "data/hardware_logs"
    shutil.rmtree(logs)
    logs.mkdir()
    shutil.rmtree(made.root / "data/feedback", ignore_errors=True)
    place = "    why = stale_now("
    made.replace("assets/database.py", place, KILLS + place)
    made.replace("assets/sensors.py", "\nEVERY_S = 30\n", f"\nEVERY_S = {EVERY_S:.0f}\n")
    made.materialize()
    return made


def test_what_failed_in_a_dropped_log_weighs_more_in_the_next_database(checkout, root, record_property):
    before, counts, database = _index(checkout), checkout.counts(), checkout.database()
    assert _metadata(checkout, "curation_feedback") is None, "the database needs no logs"
    approved = checkout.root / "data/feedback/approved.yaml"
    approved.parent.mkdir(exist_ok=True)
    approved.write_text("approvals: 3\n")
    used = ProcessorTime(checkout)
    with web_ui(checkout) as page:
        log = checkout.root / f"data/hardware_logs/{LOG}.mcap"
        shutil.copy(root / f"data/hardware_logs/demo/{LOG}.mcap", log)
        dropped_s = time.time()
        proposed = _wait_for(lambda: used.look() or _metadata(checkout, "curation_feedback"))
        _held_the_minute(checkout, dropped_s, used, record_property)
        assert "approved.yaml: 'approvals' is 3" in proposed["invalid approved changes"]
        assert page.materialize("expert_db") == "FAILURE", "it heeds what can't be read"
        assert checkout.counts()["expert_db"] == counts["expert_db"], "nothing takes effect unseen"
        assert proposed["changes pending"] > 0
        approved.unlink()
        (checkout.root / "data/die_here").touch()
        token = Project(checkout.root).approval_token.read_text()
        _approve(page, proposed["proposal"], token, "weights")
        told = _wait_for(lambda: _told_of_approval(checkout))
        assert told["changes pending"] == proposed["changes pending"] - 1, "the page says so without another log"
        first, *again = _wait_for(lambda: _ended_well(checkout, "recurate"))
    assert not (checkout.root / "data/die_here").exists()
    assert first == "FAILURE" and again == ["SUCCESS"], "one died before the database, the next was through"
    made = {name for name, count in checkout.counts().items() if count > counts[name]}
    assert made == {"feasible_motions", "expert_db"}, "weights touch nothing else"
    assert checkout.recomputed()["feasible_motions"] == 0
    after = _index(checkout)
    share, raised = _share(checkout, before), _share(checkout, after)
    factor = 1.25  # of one log, data/feedback_rules.yaml
    assert raised == pytest.approx(factor * share / (1.0 + (factor - 1.0) * share), rel=1e-6)
    assert database.keys() == checkout.database().keys(), "the same clips"
    (change,) = _effects(checkout)["weights"]
    assert (change["what"], change["value"]) == (CELL, 1.25)
    _leads_back_to(change, log)


def test_seconds_and_speeds_that_are_approved_too_work_on_the_clips_of_that_skill_alone(checkout):
    before, names, fates = checkout.counts(), set(_index(checkout)["clip"]), _fates_of_references(checkout)
    project = Project(checkout.root)
    proposal = _metadata(checkout, "curation_feedback")["proposal"]
    approve_proposal(project.feedback, proposal, "a person", sections=("selection", "augmentation"))
    checkout.materialize()
    made = {name for name, count in checkout.counts().items() if count > before[name]}
    assert made >= {"selected_motions", *ROLLED_OUT, "feasible_motions", "expert_db"}
    assert made.isdisjoint({"motion_catalog", "robot_model", "actuator_calibration", "adapted_robot"})
    now = _fates_of_references(checkout)
    assert {name: now[name] for name in fates} == fates, "further variants change no verdict on earlier references"
    further = now.keys() - fates.keys()
    assert _marks(further) == {"x0.85", "x1.15", "step_width0.02"} and all("side_left" in name for name in further)
    new = {name.partition("~rollout")[0] for name in set(_index(checkout)["clip"]) - names}
    assert new == {name for name in further if now[name] != "rejected"}, "all that the tracker follows"
    assert names <= set(_index(checkout)["clip"])
    touched = {name: count for name, count in checkout.recomputed().items() if name in made and count}
    assert set(touched) == {*ROLLED_OUT, "feasible_motions"}, "no window was cut, repaired or retargeted anew"
    assert touched["feasible_motions"] < checkout.clips_from("side_left")["feasible_motions"], "the new variants alone"
    effects = _effects(checkout)
    assert set(effects) == {"weights", "selection", "augmentation"}, "what was approved before is in it still"
    for changes in effects.values():
        _leads_back_to(changes[0], checkout.root / f"data/hardware_logs/{LOG}.mcap")


def test_a_motor_that_two_logs_show_weaker_is_weaker_in_the_model_that_judges_clips(checkout):
    before, project = checkout.counts(), Project(checkout.root)
    proposal = propose_into(project, *(report(number, saturated(36.0)) for number in range(2)))
    approve_proposal(project.feedback, proposal, "a person", sections=("motors",))
    checkout.materialize()
    made = {name for name, count in checkout.counts().items() if count > before[name]}
    assert made - {"tracking_policy"} == {"adapted_robot", *ROLLED_OUT[1:], "feasible_motions", "expert_db"}
    limits = {each.joint: each.box_effort_limit for each in read_actuators(project.adapted_robot("t1"))}
    assert limits["Left_Knee_Pitch"] == 36.0 < limits["Right_Knee_Pitch"]
    assert checkout.recomputed()["feasible_motions"] > 0, "every clip is judged by the weaker model"
    assert set(_effects(checkout)) == {"weights", "selection", "augmentation", "motors"}
    assert [each["sha256"] for each in _effects(checkout)["motors"][0]["witnesses"]] == [f"{0:064d}", f"{1:064d}"]


def _held_the_minute(checkout: Checkout, dropped_s: float, used: ProcessorTime, record: Callable[[str, Any], None]):
    """A minute from a dropped log to its trials, in what does not depend on who else uses the machine."""
    (run,) = runs_of(checkout, "ingest_logs")
    ticks = ticks_of(checkout, "hardware_log_sensor")
    (asked,) = [tick for tick in ticks if run.run_id in tick.run_ids]
    quiet_s = dropped_s + QUIET_S
    late = [tick for tick in ticks if quiet_s < tick.timestamp < asked.timestamp]
    assert late == [], "the first tick after the file was quiet asks for the run"
    gaps = np.diff([tick.timestamp for tick in ticks])
    assert all(gap >= EVERY_S - 1.0 for gap in gaps) and asked.timestamp - quiet_s <= max([EVERY_S, *gaps])
    if sys.platform == "linux":
        assert 0.0 < used.of_run[run.run_id] <= INGEST_S
        record("processor time of the run that ingests [s]", round(used.of_run[run.run_id], 1))
    record("from drop to tick [s]", round(asked.timestamp - dropped_s, 1))
    record("from tick to start of the run [s]", round(run.start_s - asked.timestamp, 1))
    record("from drop to proposal, all told [s]", round(time.time() - dropped_s, 1))
    record("load of the machine meanwhile", os.getloadavg()[0])


def _ended_well(checkout: Checkout, job: str) -> list[str]:
    """What became of the runs of a job, as soon as one succeeded."""
    found = [run.status for run in runs_of(checkout, job)]
    return found if "SUCCESS" in found else []


def _approve(page: WebUi, proposal: str, token: str, *sections: str) -> None:
    approval = {"proposal": proposal, "by": "a person", "token": token, "sections": list(sections)}
    assert page.launch("approve_feedback", {"ops": {"approve": {"config": approval}}}) == "SUCCESS"


def _told_of_approval(checkout: Checkout) -> dict[str, Any] | None:
    """The page of curation_feedback as soon as it knows of what is approved."""
    page = _metadata(checkout, "curation_feedback")
    return page if page and page["changes approved"] else None


def _index(checkout: Checkout) -> pd.DataFrame:
    return pd.read_parquet(checkout.root / "data/expert_db/t1/index.parquet")


def _fates_of_references(checkout: Checkout) -> dict[str, str]:
    """Name of each reference -> what became of its rollouts in KP4."""
    judged = Store(root=checkout.root / "data/store").load("augmented_motions").judged
    return {row.clip: row.fate for row in judged}


def _marks(names: Iterable[str]) -> set[str]:
    """What variants of these names change: `x0.85` of `side_left@0-89~x0.85`."""
    return {name.rpartition("~")[2] for name in names}


def _share(checkout: Checkout, index: pd.DataFrame) -> float:
    """Share of draws that land in the cell: a clip by its weight, then a time within it."""
    commands = settings.read(checkout.root / "data/commands.yaml", CommandSettings)
    weight = index["weight"].to_numpy()
    return float(np.sum(weight * cell_parts(index, [CELL], commands)[:, 0]) / np.sum(weight))


def _effects(checkout: Checkout) -> dict[str, list[dict[str, Any]]]:
    """Section -> the changes that took effect in the database, as its manifest says."""
    stages = json.loads((checkout.root / "data/expert_db/t1/manifest.json").read_text())["stages"].values()
    named = {str(each.get("stage")): each for each in stages}
    head = "feedback on "
    return {name.removeprefix(head): each["changes"] for name, each in named.items() if name.startswith(head)}


def _leads_back_to(change: dict[str, Any], log: Path) -> None:
    """A change names the log by its bytes."""
    (witness,) = change["witnesses"]
    assert witness["sha256"] == digest.of_file(log)
    assert witness["simulated"] and "fall left" in witness["said"]


def _metadata(checkout: Checkout, name: str) -> dict[str, Any] | None:
    """Of the newest materialization of an asset."""
    with checkout.instance() as instance:
        event = instance.get_latest_materialization_event(dg.AssetKey([name]))
    if event is None or event.asset_materialization is None:
        return None
    return {key: value.value for key, value in event.asset_materialization.metadata.items()}


def _wait_for(found: Callable[[], Any]) -> Any:
    """What must hold on any machine, however busy, is in ticks of the sensor and in processor time."""
    stop = time.monotonic() + PATIENCE_S
    while time.monotonic() < stop:
        value = found()
        if value:
            return value
        time.sleep(0.5)
    raise TimeoutError(f"nothing came of it in {PATIENCE_S:g} s")
