"""Logs become trials asset-wise: each read once, none stops the others, copies and half copies change nothing."""

import logging
import os
import shutil
import time
from pathlib import Path

import dagster as dg
import numpy as np
import pytest

import assets.bootstrap
import assets.definitions
import assets.hardware
import assets.resources
import assets.sensors
from assets.bootstrap import assets_of
from assets.freshness import INPUT_VERSION_PREFIX
from assets.hardware import IngestedLogs, hardware_logs, hardware_trials, ingest_folder, logs_version, trials_of
from assets.plan import TRIALS
from assets.resources import StoreIOManager
from assets.runs import alive
from assets.sensors import hardware_log_sensor, ingest_logs
from assets.sources import DATA_VERSION_TAG
from pipeline.files import digest, settings
from pipeline.hardware_logs import LogSettings, Storage, mcap_bytes, read_trial
from pipeline.project import Project
from tests.factories.robot_logs import POLICY, START_NS, every, low_states, robot_log

LONG_AGO_S = 3_600.0
PAGE = (
    ("hardware_trials", "failure_modes"),
    ("failure_modes", "curation_feedback"),
    ("failure_modes", "sim_to_real_report"),
)
"""What is made of the trials, after what it is made of."""


@pytest.fixture
def project(root, tmp_path, monkeypatch) -> Project:
    """A project of its own, without motions, logs or a store."""
    made = Project(tmp_path)
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots/t1").symlink_to(root / "robots/t1")
    made.hardware_logs.mkdir(parents=True)
    for path in (root / "data").glob("*.yaml"):
        shutil.copy(path, made.data)
    (made.data / "motions").mkdir()
    for module in (assets.hardware, assets.sensors, assets.resources):
        monkeypatch.setattr(module, "PROJECT", made)
    return made


@pytest.fixture(scope="module")
def log_bytes() -> bytes:
    from pipeline.robot import load_robot

    return mcap_bytes(robot_log(load_robot("t1"), 1.0), Storage(chunk_bytes=60_000))


def drop(project: Project, name: str, data: bytes, age_s: float = LONG_AGO_S) -> Path:
    """Put a file into the folder that was last written `age_s` ago."""
    path = project.hardware_logs / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    then = time.time() - age_s
    os.utime(path, (then, then))
    return path


def ingested(project: Project) -> IngestedLogs:
    """What the asset does, and its manifest as the current one."""
    values = settings.read(project.settings("hardware_logs.yaml"), LogSettings)
    found = ingest_folder(project, TRIALS, values, logging.getLogger())
    project.store.save("hardware_trials", found.manifest)
    return found


def test_a_log_becomes_a_trial_in_the_store(project, log_bytes, robot):
    drop(project, "day1/walk.mcap", log_bytes)
    found = ingested(project)
    ((name, path, numbers),) = trials_of(found.manifest)
    trial = read_trial(path)
    assert name == trial.name == "day1/walk"
    assert numbers["policy_digest"] == trial.policy_digest == POLICY
    assert numbers["log"] == "day1/walk"
    np.testing.assert_array_equal(trial.joint_pos, robot_log(robot, 1.0).low_state.joint_pos.astype(np.float32))
    assert not list((project.store.root / "ingest").iterdir())


def test_what_a_killed_run_left_is_removed(project, log_bytes):
    drop(project, "day1/walk.mcap", log_bytes)
    (project.store.root / "ingest" / "tmp1").mkdir(parents=True)
    (project.store.root / "ingest" / "tmp1" / "half.parquet").write_bytes(b"half")
    ingested(project)
    assert not list((project.store.root / "ingest").iterdir())


def test_an_empty_folder_and_none_at_all_are_fine(project):
    assert ingested(project).manifest.entries == ()
    project.hardware_logs.rmdir()
    assert ingested(project).manifest.judged == ()


def test_a_bad_log_gets_its_sentence_and_does_not_stop_the_others(project, log_bytes):
    drop(project, "a.mcap", b"no log at all" * 10)
    drop(project, "b.mcap", log_bytes)
    drop(project, "c.mcap", log_bytes[: len(log_bytes) // 2])
    manifest = ingested(project).manifest
    assert [entry.clip for entry in manifest.entries] == ["b", "c"]
    assert [row.fate for row in manifest.judged] == ["rejected", "accepted", "accepted"]
    assert manifest.entries[1].numbers["integrity"] == "recovered"
    (note,) = (project.hardware_logs / "quarantine").iterdir()
    assert note.name == "a.txt"
    text = note.read_text()
    assert text.startswith("a: not an MCAP file")
    assert text.count("\n") == 1


@pytest.mark.parametrize("name", ["r" * 246 + ".mcap", "session.txt/bad.mcap", "\udcff.mcap"])
def test_no_name_of_a_refused_log_stops_the_others(project, log_bytes, name):
    drop(project, "b.mcap", log_bytes)
    bad = drop(project, name, b"no log at all" * 10)
    for _ in range(2):
        found = ingested(project)
        assert sorted(row.fate for row in found.manifest.judged) == ["accepted", "rejected"]
    bad.unlink()
    assert [row.fate for row in ingested(project).manifest.judged] == ["accepted"]
    assert not list((project.hardware_logs / "quarantine").rglob("*"))


def test_a_folder_that_cannot_be_written_stops_no_log(project, log_bytes):
    drop(project, "a.mcap", b"no log at all" * 10)
    drop(project, "b.mcap", log_bytes)
    (project.hardware_logs / "quarantine").write_text("")  # as of a folder that is mounted read-only, for root too
    found = ingested(project)
    assert [row.fate for row in found.manifest.judged] == ["rejected", "accepted"]
    assert any("can't be written" in sentence for sentence in found.passed_over)


def test_a_memory_of_digests_that_is_not_one_counts_as_empty(project, log_bytes):
    drop(project, "b.mcap", log_bytes)
    project.log_digests.parent.mkdir(parents=True)
    project.log_digests.write_text("null")
    assert len(ingested(project).manifest.entries) == 1


def test_a_log_that_is_healed_leaves_quarantine(project, log_bytes):
    drop(project, "a.mcap", b"no log at all" * 10)
    ingested(project)
    drop(project, "a.mcap", log_bytes)
    assert [entry.clip for entry in ingested(project).manifest.entries] == ["a"]
    assert not list((project.hardware_logs / "quarantine").iterdir())


def test_logs_are_read_once(project, log_bytes):
    drop(project, "a.mcap", log_bytes)
    drop(project, "b.mcap", b"no log at all" * 10)
    first = ingested(project).manifest
    second = ingested(project).manifest
    assert (first.recomputed, second.recomputed) == (2, 0)
    assert first.digest == second.digest


@pytest.mark.parametrize("name", ["z.mcap", "0.mcap", "other/a.mcap"])
def test_a_log_that_comes_again_changes_nothing(project, log_bytes, name):
    drop(project, "a.mcap", log_bytes)
    before, version = ingested(project).manifest, logs_version(project)[0]
    drop(project, name, log_bytes)
    drop(project, "a.mcap", log_bytes, age_s=100.0)
    after = ingested(project)
    assert after.manifest.digest == before.digest
    assert logs_version(project)[0] == version
    assert after.passed_over == (f"{name.removesuffix('.mcap')} has the content of a.",)


def test_a_sidecar_speaks_for_its_log(project, log_bytes):
    drop(project, "a.mcap", log_bytes)
    before = logs_version(project)[0]
    drop(project, "a.yaml", b"events: [{time_s: 0.25, kind: stop}]\n")
    assert logs_version(project)[0] != before
    ((_, path, _),) = trials_of(ingested(project).manifest)
    (event,) = [event for event in read_trial(path).events if event.source == "sidecar"]
    assert (event.kind, event.time_s) == ("stop", 0.25)


def test_a_sidecar_that_contradicts_its_log_refuses_it(project, log_bytes):
    drop(project, "a.mcap", log_bytes)
    drop(project, "a.yaml", b"robot: k1\n")
    (row,) = ingested(project).manifest.judged
    assert row.fate == "rejected"
    assert "states the robot 't1', its sidecar 'k1'" in row.reasons[0]["text"]


def test_what_is_still_being_copied_waits(project, log_bytes):
    drop(project, "half.mcap", log_bytes[: len(log_bytes) // 2], age_s=10.0)
    drop(project, "fresh.mcap", log_bytes, age_s=0.0)
    found = ingested(project)
    assert found.manifest.judged == ()
    assert [each.split()[0] for each in found.passed_over] == ["fresh.mcap", "half.mcap"]
    assert all("is still being written" in each for each in found.passed_over)


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
            tags = tick(instance)
            assert isinstance(tags, dict)
            run = instance.create_run_for_job(ingest_job(), tags=tags, status=dg.DagsterRunStatus.STARTED)
            assert "a run was started for these" in tick(instance)
            drop(project, "again.mcap", log_bytes)
            assert "a run was started for these" in tick(instance)
            instance.report_run_failed(run)
        assert "3 runs for these" in tick(instance)
        drop(project, "b.mcap", log_bytes[:-1])
        assert isinstance(tick(instance), dict)


def test_a_run_that_a_person_cancels_is_not_started_again_until_a_log_comes(project, log_bytes):
    drop(project, "a.mcap", log_bytes)
    with dg.DagsterInstance.ephemeral() as instance:
        tags = tick(instance)
        assert isinstance(tags, dict)
        run = instance.create_run_for_job(ingest_job(), tags=tags, status=dg.DagsterRunStatus.STARTED)
        instance.report_run_canceled(run)
        assert f"run {run.run_id} for these 1 logs was cancelled" in tick(instance)
        drop(project, "b.mcap", log_bytes[:-1])
        assert isinstance(tick(instance), dict)


def test_a_run_that_died_with_its_machine_is_told_failed_and_tried_again(project, log_bytes):
    drop(project, "a.mcap", log_bytes)
    with dg.DagsterInstance.ephemeral() as instance:
        tags = tick(instance)
        assert isinstance(tags, dict)
        run = instance.create_run_for_job(ingest_job(), tags=tags, status=dg.DagsterRunStatus.STARTED)
        with alive(project.store.root / "runs", run.run_id):
            assert "a run was started for these" in tick(instance)
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
        assert "'approvals' is 3, wanted a list. Mend it, or delete it" in noted.metadata["can't be used"].value


def test_a_log_called_like_the_second_trial_of_another_one_is_not_mistaken_for_it(project, log_bytes, robot):
    times = every(3.0, 500)
    silent = (times >= START_NS + 1.0e9) & (times < START_NS + 2.5e9)
    paused = mcap_bytes(robot_log(robot, 3.0, low_state=low_states(robot, times[~silent])))
    logs = {"x": drop(project, "x.mcap", paused), "x+2.mcap": drop(project, "x+2.mcap", log_bytes)}
    found = {name: (read_trial(path), numbers) for name, path, numbers in trials_of(ingested(project).manifest)}
    of_log = {name: numbers["log"] for name, (_, numbers) in found.items()}
    assert of_log == {"x": "x", "x+2": "x", "x+2.mcap": "x+2.mcap"}
    for name, (trial, numbers) in found.items():
        assert trial.name == name
        assert trial.log_digest == numbers["log_sha256"] == digest.of_file(logs[numbers["log"]])


def test_logs_that_come_back_are_ingested_again_however_often(project, log_bytes):
    drop(project, "a.mcap", log_bytes)
    with dg.DagsterInstance.ephemeral() as instance:
        tags = tick(instance)
        assert isinstance(tags, dict)
        for _ in range(3):
            instance.create_run_for_job(ingest_job(), tags=tags, status=dg.DagsterRunStatus.SUCCESS)
        assert tick(instance) == tags


def ingest_job() -> dg.JobDefinition:
    definitions = dg.Definitions(assets=[hardware_logs, hardware_trials], jobs=[ingest_logs])
    return definitions.resolve_job_def("ingest_logs")


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
