"""What follows an approval by itself: databases that are behind, runs that are tried again, and where that ends."""

import json
from contextlib import contextmanager

import dagster as dg
import pytest

from assets import runs, sensors
from assets.approved import PARTS, SHARED_PARTS, approved_part
from assets.runs import alive
from assets.sensors import (
    APPROVED_TAG,
    MAX_FAILURES,
    MAX_NIGHTLY_TRIES,
    approved_feedback_sensor,
    nightly_recuration,
    outdated_databases,
    recurate,
)
from pipeline.batch import Manifest
from pipeline.expert import history
from pipeline.feedback.approve import approve_proposal, take_back_sections
from pipeline.feedback.approved import with_applied_changes
from pipeline.feedback.change import proposal_digest
from pipeline.project import PROJECT, Project
from tests.factories.feedback_project import feedback_project, note_materialized, propose_into, two_falls
from tests.factories.trial_reports import proposal

DATABASE = dg.AssetKey(["expert_db"])
PENDING = proposal_digest(proposal(*two_falls()).changes)


@pytest.fixture
def project(root, tmp_path, monkeypatch) -> Project:
    """A project with a proposal; sensor and schedule look at it."""
    made = feedback_project(root, tmp_path)
    propose_into(made, *two_falls())
    monkeypatch.setattr(sensors, "PROJECT", made)
    return made


def approve(project: Project, *sections: str) -> None:
    approve_proposal(project.feedback, PENDING, "a person", sections=sections)


def write_database(project: Project) -> None:
    """The manifest of a database as it is made from what is approved now."""
    manifest = Manifest(stage="feasible_motions", entries=(), judged=(), settings={"0": {"stage": "x"}})
    for section in PARTS:
        robot = None if section in SHARED_PARTS else "t1"
        if section != "randomization":
            manifest = with_applied_changes(manifest, approved_part(project, section, robot), section)
    path = project.expert_db("t1") / "manifest.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"stages": manifest.settings}))


def tick(instance: dg.DagsterInstance) -> dg.RunRequest | str:
    """What the sensor asks for, or why it asks for nothing."""
    found = approved_feedback_sensor(dg.build_sensor_context(instance=instance))
    if isinstance(found, dg.SkipReason):
        return found.skip_message or ""
    assert isinstance(found, dg.RunRequest)
    return found


@contextmanager
def reached(project: Project, history=dg.DagsterInstance.ephemeral):
    """A history in which all stages and the database have heard of what is approved now.

    `history`: `dg.instance_for_test` for schedules, which read it from files
    """
    with history() as instance:
        note_materialized(instance, project)
        write_database(project)
        assert outdated_databases(instance, project) == {}
        yield instance


def run_of(instance: dg.DagsterInstance, request: dg.RunRequest, status: dg.DagsterRunStatus) -> dg.DagsterRun:
    """The run that the daemon makes of a request."""
    return instance.create_run_for_job(_job(request), tags=dict(request.tags), status=status)


def _job(request: dg.RunRequest) -> dg.JobDefinition:
    from assets.definitions import defs

    return defs.resolve_job_def(request.job_name or recurate.name)


def test_a_database_is_behind_from_an_approval_until_it_is_made(project):
    with dg.DagsterInstance.ephemeral() as instance:
        approve(project)
        assert outdated_databases(instance, project) == {}, "what was never made heeds it when it is made"
        project.feedback.approved.unlink()
        note_materialized(instance, project)
        assert outdated_databases(instance, project) == {}
        approve(project, "weights")
        assert outdated_databases(instance, project) == {DATABASE: "approved_weights changed"}
        note_materialized(instance, project)
        assert outdated_databases(instance, project) == {}


def test_a_robot_without_a_database_is_not_behind(project):
    (project.root / "robots/k1").symlink_to(PROJECT.robot_folder("k1"))
    with dg.DagsterInstance.ephemeral() as instance:
        note_materialized(instance, project)
        approve(project)
        assert set(outdated_databases(instance, project)) == {DATABASE}, (
            "what is approved for all robots makes no first database"
        )


def test_a_restored_database_stays_until_something_else_is_approved(project):
    with reached(project) as instance:
        approve(project, "augmentation")
        note_materialized(instance, project)
        assert isinstance(tick(instance), dg.RunRequest), "it did not hear of the approval"
        folder, approved = project.expert_db("t1"), project.feedback.approved
        (folder.parent / ".t1.restored").write_text(history._restored_as(folder, approved))
        assert str(tick(instance)).endswith("; not updated, because a person restored them: t1")
        approve(project, "weights")
        assert outdated_databases(instance, project) == {DATABASE: "approved_weights changed"}
        note_materialized(instance, project)
        assert list(outdated_databases(instance, project)) == [DATABASE], "the stages ran, and then the run died"


@pytest.mark.parametrize("section", ["selection", "augmentation", "weights", "motors"])
def test_a_database_is_behind_while_it_does_not_say_that_it_heard(project, section):
    with reached(project) as instance:
        approve(project, section)
        note_materialized(instance, project)
        (why,) = outdated_databases(instance, project).values()
        assert why.endswith("is not in the database"), "the stages ran, and then the run died"
        write_database(project)
        assert outdated_databases(instance, project) == {}
        take_back_sections(project.feedback, (section,), "a person")
        note_materialized(instance, project)
        assert list(outdated_databases(instance, project)) == [DATABASE], "what is taken back is in it still"


def test_ranges_of_training_make_no_database_late(project):
    with reached(project) as instance:
        approve(project, "randomization")
        assert outdated_databases(instance, project) == {}


def test_the_sensor_and_the_schedule_ask_for_one_run_and_rest_when_it_is_through(project):
    with reached(project, dg.instance_for_test) as instance:
        schedule = dg.build_schedule_context(instance=instance)
        assert "every database contains" in tick(instance)
        assert isinstance(nightly_recuration(schedule), dg.SkipReason)
        approve(project, "weights")
        request = tick(instance)
        assert isinstance(request, dg.RunRequest) and request.asset_selection == [DATABASE]
        assert nightly_recuration(schedule).asset_selection == [DATABASE]
        run = run_of(instance, request, dg.DagsterRunStatus.STARTED)
        assert "a run for the approved changes (expert_db: approved_weights changed) is in progress" in tick(instance)
        assert isinstance(nightly_recuration(schedule), dg.SkipReason)
        note_materialized(instance, project)
        write_database(project)
        instance.report_run_canceled(run)
        assert "every database contains" in tick(instance)


def test_the_page_of_feedback_comes_first_and_keeps_no_database_waiting(project):
    page = dg.AssetKey(["curation_feedback"])
    with reached(project) as instance:
        instance.report_runless_asset_event(dg.AssetMaterialization(page))
        approve(project, "weights")
        first = tick(instance)
        assert isinstance(first, dg.RunRequest) and first.job_name == "renew_feedback_page"
        instance.create_run_for_job(_job(first), tags=dict(first.tags), status=dg.DagsterRunStatus.STARTED)
        second = tick(instance)
        assert isinstance(second, dg.RunRequest) and second.asset_selection == [DATABASE], "its run waits for the page"
        assert second.job_name == recurate.name


def test_a_run_that_comes_to_nothing_is_tried_again_a_few_times_and_no_more(project):
    with reached(project, dg.instance_for_test) as instance:
        approve(project, "weights")
        for count in range(MAX_NIGHTLY_TRIES):
            asked = tick(instance)
            if count >= MAX_FAILURES:
                assert f"{count} runs for the approved changes (expert_db: approved_weights changed) failed" in asked
                asked = nightly_recuration(dg.build_schedule_context(instance=instance))
            assert isinstance(asked, dg.RunRequest)
            instance.report_run_failed(run_of(instance, asked, dg.DagsterRunStatus.STARTED))
        last = nightly_recuration(dg.build_schedule_context(instance=instance))
        assert "start the job recurate by hand" in last.skip_message
        approve(project, "motors")
        assert isinstance(tick(instance), dg.RunRequest), "something else is approved"


def test_a_run_that_a_person_cancels_is_not_started_again_until_something_changes(project):
    with reached(project, dg.instance_for_test) as instance:
        approve(project, "weights")
        request = tick(instance)
        assert isinstance(request, dg.RunRequest)
        run = run_of(instance, request, dg.DagsterRunStatus.STARTED)
        instance.report_run_canceling(run)
        assert "is in progress" in str(tick(instance))
        instance.report_run_canceled(run)
        assert f"run {run.run_id} for the approved changes (expert_db: approved_weights changed) was cancelled" in str(
            tick(instance)
        )
        assert isinstance(nightly_recuration(dg.build_schedule_context(instance=instance)), dg.SkipReason)
        instance.report_run_failed(run_of(instance, dg.RunRequest(), dg.DagsterRunStatus.STARTED))
        assert isinstance(tick(instance), dg.RunRequest), "somebody started one by hand, which failed"
        instance.report_run_canceled(run_of(instance, request, dg.DagsterRunStatus.STARTED))
        assert "was cancelled" in str(tick(instance))
        approve(project, "motors")
        assert isinstance(tick(instance), dg.RunRequest), "something else is approved"


def test_runs_that_succeed_and_reach_nothing_do_not_go_on_for_ever(project):
    with reached(project) as instance:
        approve(project, "weights")
        for _ in range(MAX_FAILURES):
            request = tick(instance)
            assert isinstance(request, dg.RunRequest)
            run_of(instance, request, dg.DagsterRunStatus.SUCCESS)
        assert "failed" in tick(instance)
        run_of(instance, dg.RunRequest(), dg.DagsterRunStatus.SUCCESS)
        assert isinstance(tick(instance), dg.RunRequest), "somebody started one by hand in between"


def test_what_is_approved_again_after_it_was_taken_back_is_run_again(project):
    with reached(project) as instance:
        for _ in range(MAX_FAILURES + 1):
            approve(project, "weights")
            request = tick(instance)
            assert isinstance(request, dg.RunRequest)
            run_of(instance, request, dg.DagsterRunStatus.SUCCESS)
            write_database(project)
            note_materialized(instance, project)
            take_back_sections(project.feedback, ("weights",), "a person")
            request = tick(instance)
            assert isinstance(request, dg.RunRequest)
            run_of(instance, request, dg.DagsterRunStatus.SUCCESS)
            write_database(project)
            note_materialized(instance, project)


def test_a_run_whose_process_is_gone_is_told_failed_and_tried_again(project):
    runs = project.store.root / "runs"
    with reached(project) as instance:
        approve(project, "weights")
        request = tick(instance)
        assert isinstance(request, dg.RunRequest)
        run = run_of(instance, request, dg.DagsterRunStatus.STARTED)
        with alive(runs, run.run_id):
            assert "is in progress" in tick(instance)
        (runs / run.run_id).write_text("of a process that was killed, whose lock the system released")
        again = tick(instance)
        assert isinstance(again, dg.RunRequest) and again.tags[APPROVED_TAG] == request.tags[APPROVED_TAG]
        assert instance.get_run_by_id(run.run_id).status == dg.DagsterRunStatus.FAILURE


def test_a_run_that_never_took_its_lock_is_not_waited_for_for_ever(project, monkeypatch):
    with reached(project) as instance:
        approve(project, "weights")
        request = tick(instance)
        assert isinstance(request, dg.RunRequest)
        run = run_of(instance, request, dg.DagsterRunStatus.STARTING)
        assert "is in progress" in tick(instance)
        monkeypatch.setattr(runs, "START_S", 0.0)
        assert isinstance(tick(instance), dg.RunRequest)
        with alive(project.store.root / "runs", run.run_id):
            assert "is in progress" in tick(instance), "it has its lock"


def test_a_broken_file_of_approvals_is_told_and_starts_nothing(project):
    project.feedback.approved.parent.mkdir(parents=True, exist_ok=True)
    project.feedback.approved.write_text("approvals: 3\n")
    with dg.DagsterInstance.ephemeral() as instance:
        assert "approved.yaml: 'approvals' is 3" in tick(instance)


def test_a_section_that_no_database_heeds_stops_none(project):
    with reached(project) as instance:
        approve(project)
        text = project.feedback.approved.read_text()
        assert text.count("value: 0.8") == 1, "the range of gains"
        project.feedback.approved.write_text(text.replace("value: 0.8", "value: 0.7"))
        assert set(project.feedback.approvals().faults) == {"randomization"}
        request = tick(instance)
        assert isinstance(request, dg.RunRequest) and request.asset_selection == [DATABASE]
        project.feedback.approved.write_text(text.replace("value: 1.5625", "value: 1.5"))
        assert "'weights': its changes do not have the digest" in str(tick(instance))


def test_jobs_sensors_and_schedules_run_by_themselves_but_training_does_not():
    from assets.definitions import defs

    sensors = {each.name: each.default_status for each in defs.sensors}
    assert sensors["approved_feedback_sensor"] == sensors["hardware_log_sensor"] == dg.DefaultSensorStatus.RUNNING
    assert [each.default_status for each in defs.schedules] == [dg.DefaultScheduleStatus.RUNNING]
    jobs = {each.name for each in defs.jobs}
    assert {"ingest_logs", "recurate", "approve_feedback", "take_back_feedback", "train"} <= jobs
    started = {target.job_name for each in defs.sensors for target in each.targets}
    assert started == {"ingest_logs", "recurate", "renew_feedback_page"}
    assert {each.job_name for each in defs.schedules} == {"recurate"}
