"""Logs become trials asset-wise: each read once, none stops the others, copies and half copies change nothing."""

import logging

import numpy as np
import pytest

from assets.hardware import IngestedLogs, ingest_folder, logs_version, trials_of
from pipeline.files import digest, settings
from pipeline.hardware_logs import LogSettings, mcap_bytes, read_trial
from pipeline.project import Project
from tests.factories.log_folder import drop, log_project
from tests.factories.robot_logs import POLICY, START_NS, every, low_states, robot_log


@pytest.fixture
def project(root, tmp_path, monkeypatch) -> Project:
    return log_project(root, tmp_path, monkeypatch)


def ingested(project: Project) -> IngestedLogs:
    """What the asset does, and its manifest as the current one."""
    values = settings.read(project.settings("hardware_logs.yaml"), LogSettings)
    found = ingest_folder(project, values, logging.getLogger())
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
