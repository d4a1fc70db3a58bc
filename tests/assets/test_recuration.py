"""Approval and what follows it: a proposal by its digest, databases that are behind, what runs by itself."""

import json

import dagster as dg
import pytest

from assets import recuration
from assets.approved import PARTS, approved_versions
from assets.freshness import INPUT_VERSION_PREFIX
from assets.plan import FIELD
from assets.project import Project
from assets.recuration import ApprovalError, approve_proposal, approved_feedback_sensor, behind, nightly_recuration
from pipeline.batch import Manifest
from pipeline.feedback.approved import read_changes
from tests.factories.trial_reports import RULES, failure, proposal, report, saturated


@pytest.fixture
def project(root, tmp_path) -> Project:
    """A project with settings, a robot, and a proposal of two logs in its store."""
    (tmp_path / "data").mkdir()
    for name in ("feedback_rules.yaml",):
        (tmp_path / "data" / name).write_text((root / "data" / name).read_text())
    (tmp_path / "robots/t1").mkdir(parents=True)
    (tmp_path / "robots/t1/robot.toml").write_text("")
    made = Project(tmp_path)
    changes = proposal(*(report(number, failure(), saturated(36.0)) for number in range(2))).changes
    stored = {f"{place:04d}": change.to_dict() for place, change in enumerate(changes)}
    made.store.save("curation_feedback", Manifest(stage=FIELD[1].name, entries=(), judged=(), settings=stored))
    return made


def _pending(project: Project) -> str:
    """The digest that a page would show."""
    from pipeline.feedback.change import Change, Witness, proposal_digest

    stored = json.loads(project.store.manifest_path("curation_feedback").read_text())["settings"]
    changes = [
        Change(**{**each, "witnesses": tuple(Witness(**one) for one in each["witnesses"])})
        for _, each in sorted(stored.items())
    ]
    return proposal_digest(changes)


def test_what_was_looked_at_is_what_is_approved(project):
    count = approve_proposal(project, _pending(project), "a person")
    approved = read_changes(project.approved_feedback, RULES)
    assert len(approved) == count == 5
    assert {change.section for change in approved} == set(PARTS)


def test_another_digest_approves_nothing(project):
    with pytest.raises(ApprovalError, match="proposal 'beef' is not pending"):
        approve_proposal(project, "beef", "a person")
    with pytest.raises(ApprovalError, match="an approval needs a name"):
        approve_proposal(project, _pending(project), " ")
    assert not project.approved_feedback.exists()


def test_parts_and_policies_can_be_approved_alone(project):
    approve_proposal(project, _pending(project), "a person", sections=("weights",))
    assert {change.section for change in read_changes(project.approved_feedback, RULES)} == {"weights"}
    approve_proposal(project, _pending(project), "a person", policies=("a" * 64,))
    assert {change.section for change in read_changes(project.approved_feedback, RULES)} == set(PARTS)
    with pytest.raises(ApprovalError, match="nothing was approved"):
        approve_proposal(project, _pending(project), "a person", policies=("b" * 64,))


def _materialized(instance: dg.DagsterInstance, project: Project) -> None:
    """Note all stages as made from what is approved now."""
    versions = {key.to_user_string(): version for key, (version, _) in approved_versions(project).items()}
    for name in ("selected_motions", "augmented_motions", "feasible_motions", "adapted_robot"):
        tags = {f"{INPUT_VERSION_PREFIX}{key}": version for key, version in versions.items()}
        instance.report_runless_asset_event(dg.AssetMaterialization(dg.AssetKey([name]), tags=tags))


def test_a_database_is_behind_from_an_approval_until_it_is_made(project, monkeypatch):
    monkeypatch.setattr(recuration, "PROJECT", project)
    with dg.instance_for_test() as instance:
        approve_proposal(project, _pending(project), "a person")
        assert behind(instance, project) == {}, "what was never made heeds it when it is made"
        project.approved_feedback.unlink()
        _materialized(instance, project)
        assert behind(instance, project) == {}
        approve_proposal(project, _pending(project), "a person", sections=("weights",))
        assert list(behind(instance, project)) == [dg.AssetKey(["expert_db"])]
        _materialized(instance, project)
        assert behind(instance, project) == {}


def test_the_sensor_starts_one_run_for_each_approval_and_the_schedule_skips_where_nothing_changed(project, monkeypatch):
    monkeypatch.setattr(recuration, "PROJECT", project)
    with dg.instance_for_test() as instance:
        _materialized(instance, project)
        sensor = dg.build_sensor_context(instance=instance)
        assert isinstance(approved_feedback_sensor(sensor), dg.SkipReason)
        schedule = dg.build_schedule_context(instance=instance)
        assert isinstance(nightly_recuration(schedule), dg.SkipReason)
        approve_proposal(project, _pending(project), "a person", sections=("weights",))
        asked = approved_feedback_sensor(sensor)
        assert [request.asset_selection for request in asked.run_requests] == [[dg.AssetKey(["expert_db"])]]
        again = approved_feedback_sensor(dg.build_sensor_context(instance=instance, cursor=asked.cursor))
        assert isinstance(again, dg.SkipReason)
        assert nightly_recuration(schedule).asset_selection == [dg.AssetKey(["expert_db"])]


def test_a_broken_file_of_approvals_is_told_and_starts_nothing(project, monkeypatch):
    monkeypatch.setattr(recuration, "PROJECT", project)
    project.approved_feedback.parent.mkdir(parents=True, exist_ok=True)
    project.approved_feedback.write_text("proposal: x\nchanges: 3\n")
    with dg.instance_for_test() as instance:
        skipped = approved_feedback_sensor(dg.build_sensor_context(instance=instance))
        assert "approved.yaml" in skipped.skip_message


def test_jobs_sensors_and_schedules_run_by_themselves_but_training_does_not():
    from assets.definitions import defs

    sensors = {each.name: each.default_status for each in defs.sensors}
    assert sensors["approved_feedback_sensor"] == sensors["hardware_log_sensor"] == dg.DefaultSensorStatus.RUNNING
    assert [each.default_status for each in defs.schedules] == [dg.DefaultScheduleStatus.RUNNING]
    jobs = {each.name for each in defs.jobs}
    assert {"ingest_logs", "recurate", "approve_feedback", "train"} <= jobs
    started = {name for each in (*defs.sensors, *defs.schedules) for name in [each.job_name]}
    assert started == {"ingest_logs", "recurate"}
