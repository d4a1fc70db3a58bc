"""The sensor of hardware logs: one run for new logs, tried again where it failed, until they reached the page."""

import dagster as dg
import pytest

import assets.bootstrap
import assets.definitions
from assets.bootstrap import assets_of
from assets.freshness import INPUT_VERSION_PREFIX
from assets.hardware import hardware_logs, hardware_trials
from assets.plan import TRIALS
from assets.resources import StoreIOManager
from assets.runs import alive
from assets.sensors import hardware_log_sensor, ingest_logs
from assets.sources import DATA_VERSION_TAG
from pipeline.project import Project
from tests.factories.log_folder import drop, log_project

PAGE = (
    ("hardware_trials", "failure_modes"),
    ("failure_modes", "curation_feedback"),
    ("failure_modes", "sim_to_real_report"),
)
"""What is made of the trials, after what it is made of."""


@pytest.fixture
def project(root, tmp_path, monkeypatch) -> Project:
    return log_project(root, tmp_path, monkeypatch)


def materialize(instance: dg.DagsterInstance) -> dg.ExecuteInProcessResult:
    resources = {"io_manager": StoreIOManager(bootstrap=False)}
    return dg.materialize([hardware_logs, hardware_trials], instance=instance, resources=resources)


def tick(instance: dg.DagsterInstance) -> dict[str, str] | str:
    """Tags of the run that the sensor asks for, or why it asks for none."""
    definitions = dg.Definitions(assets=[hardware_logs, hardware_trials], jobs=[ingest_logs])
    with dg.build_sensor_context(instance=instance, definitions=definitions) as context:
        found = hardware_log_sensor(context)
    if isinstance(found, dg.SkipReason):
        return found.skip_message or ""
    assert isinstance(found, dg.RunRequest)
    return dict(found.tags)


def ingest_job() -> dg.JobDefinition:
    definitions = dg.Definitions(assets=[hardware_logs, hardware_trials], jobs=[ingest_logs])
    return definitions.resolve_job_def("ingest_logs")


def started(instance: dg.DagsterInstance) -> tuple[dict[str, str], dg.DagsterRun]:
    """Tags of the run that the sensor asks for, and that run, which goes on."""
    tags = tick(instance)
    assert isinstance(tags, dict)
    return tags, instance.create_run_for_job(ingest_job(), tags=tags, status=dg.DagsterRunStatus.STARTED)


def test_the_sensor_waits_for_a_whole_log(project, log_bytes):
    with dg.DagsterInstance.ephemeral() as instance:
        assert tick(instance) == "no new log: 0 are ingested, 0 still being written"
        drop(project, "a.mcap", log_bytes[: len(log_bytes) // 2], age_s=10.0)
        assert tick(instance) == "no new log: 0 are ingested, 1 still being written"
        drop(project, "a.mcap", log_bytes, age_s=10.0)
        assert isinstance(tick(instance), dict)


def test_the_sensor_starts_one_run_for_the_same_logs_and_tries_again_what_failed(project, log_bytes):
    drop(project, "a.mcap", log_bytes)
    with dg.DagsterInstance.ephemeral() as instance:
        for _ in range(3):
            _, run = started(instance)
            assert "is in progress" in tick(instance)
            drop(project, "again.mcap", log_bytes)
            assert "is in progress" in tick(instance)
            instance.report_run_failed(run)
        assert "3 runs for these" in tick(instance)
        drop(project, "b.mcap", log_bytes[:-1])
        assert isinstance(tick(instance), dict)


def test_a_run_that_a_person_cancels_is_not_started_again_until_a_log_comes(project, log_bytes):
    drop(project, "a.mcap", log_bytes)
    with dg.DagsterInstance.ephemeral() as instance:
        _, run = started(instance)
        instance.report_run_canceled(run)
        assert f"run {run.run_id} for these 1 logs was cancelled" in tick(instance)
        drop(project, "b.mcap", log_bytes[:-1])
        assert isinstance(tick(instance), dict)


def test_a_run_that_died_with_its_machine_is_told_failed_and_tried_again(project, log_bytes):
    drop(project, "a.mcap", log_bytes)
    with dg.DagsterInstance.ephemeral() as instance:
        tags, run = started(instance)
        with alive(project.store.root / "runs", run.run_id):
            assert "is in progress" in tick(instance)
        (project.store.root / "runs" / run.run_id).write_text("its lock went with its process")
        assert tick(instance) == tags
        told = instance.get_run_by_id(run.run_id)
        assert told is not None and told.status == dg.DagsterRunStatus.FAILURE


def test_trials_that_a_person_ingested_go_on_to_the_page(project, log_bytes):
    drop(project, "a.mcap", log_bytes)
    with dg.DagsterInstance.ephemeral() as instance:
        assets.bootstrap.note_external(instance, project)
        assert materialize(instance).success, "the trials alone"
        tags = tick(instance)
        assert isinstance(tags, dict)
        instance.create_run_for_job(ingest_job(), tags=tags, status=dg.DagsterRunStatus.SUCCESS)
        assert "no new log" in tick(instance)


def test_a_run_that_failed_behind_the_trials_is_tried_again(project, log_bytes):
    drop(project, "a.mcap", log_bytes)
    with dg.DagsterInstance.ephemeral() as instance:
        tags = tick(instance)
        assert isinstance(tags, dict)
        assets.bootstrap.note_external(instance, project)
        assert materialize(instance).success
        run = instance.create_run_for_job(ingest_job(), tags=tags, status=dg.DagsterRunStatus.STARTED)
        instance.report_run_failed(run)
        assert tick(instance) == tags, "the trials are there, what is made of them is not"
        instance.create_run_for_job(ingest_job(), tags=tags, status=dg.DagsterRunStatus.SUCCESS)
        assert "no new log" in tick(instance)


def test_a_broken_file_of_approvals_keeps_no_log_from_being_ingested(project, log_bytes):
    drop(project, "a.mcap", log_bytes)
    project.feedback.approved.parent.mkdir()
    project.feedback.approved.write_text("approvals: 3\n")
    with dg.DagsterInstance.ephemeral() as instance:
        assert isinstance(tick(instance), dict)
        assert materialize(instance).success
        noted = instance.get_latest_materialization_event(dg.AssetKey(["approved_weights"])).asset_materialization
        assert "'approvals' is 3, expected a list. Mend it, or delete it" in noted.metadata["can't be used"].value


def test_logs_that_come_back_are_ingested_again_however_often(project, log_bytes):
    drop(project, "a.mcap", log_bytes)
    with dg.DagsterInstance.ephemeral() as instance:
        tags = tick(instance)
        assert isinstance(tags, dict)
        for _ in range(3):
            instance.create_run_for_job(ingest_job(), tags=tags, status=dg.DagsterRunStatus.SUCCESS)
        assert tick(instance) == tags


def test_the_sensor_rests_when_the_logs_are_ingested(project, log_bytes):
    drop(project, "a.mcap", log_bytes)
    with dg.DagsterInstance.ephemeral() as instance:
        assets.bootstrap.note_external(instance, project)
        result = materialize(instance)
        assert result.success
        for parent, child in PAGE:
            noted = instance.get_latest_materialization_event(dg.AssetKey([parent])).asset_materialization
            tags = {INPUT_VERSION_PREFIX + parent: noted.tags[DATA_VERSION_TAG], DATA_VERSION_TAG: child}
            instance.report_runless_asset_event(dg.AssetMaterialization(dg.AssetKey([child]), tags=tags))
        assert tick(instance) == "no new log: 1 are ingested, 0 still being written"
        checks = {check.check_name: check.passed for check in result.get_asset_check_evaluations()}
        assert checks == {"every_log_readable": True, "every_log_verified": True}


def test_a_refused_log_warns_and_does_not_fail_the_run(project):
    drop(project, "a.mcap", b"no log at all" * 10)
    with dg.DagsterInstance.ephemeral() as instance:
        result = materialize(instance)
        assert result.success
        (check,) = [each for each in result.get_asset_check_evaluations() if not each.passed]
        assert check.check_name == "every_log_readable"
        assert check.severity == dg.AssetCheckSeverity.WARN


def test_a_run_of_the_whole_job_knows_its_assets_so_that_what_lies_upstream_is_made_first():
    whole = assets_of(dg.DagsterRun(job_name="ingest_logs"))
    made = ("failure_modes", "curation_feedback", "sim_to_real_report")
    assert {TRIALS.key, *(dg.AssetKey([name]) for name in made)} <= whole
    assert dg.AssetKey(["expert_db"]) not in whole
    one = {dg.AssetKey(["expert_db"])}
    assert assets_of(dg.DagsterRun(job_name="ingest_logs", asset_selection=frozenset(one))) == one


def test_the_sensor_runs_by_itself_every_half_minute():
    assert hardware_log_sensor.default_status == dg.DefaultSensorStatus.RUNNING
    assert hardware_log_sensor.minimum_interval_seconds == 30
