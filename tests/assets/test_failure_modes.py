"""Each trial is looked at once, and one that cannot be looked at stops no other."""

import dataclasses
import html

import dagster as dg
import pytest

from assets import failure_modes
from pipeline.batch import Manifest, Store
from pipeline.failures.trial_report import NOTED, TrialReport
from pipeline.hardware_logs.missed_bars import MissedBar
from pipeline.project import Project
from tests.factories.log_trials import ROOT, trials_in, write_trial


@pytest.fixture
def project(tmp_path, monkeypatch) -> Project:
    for name in ("data/failures.yaml", "data/actuators.yaml", "robots"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).symlink_to(ROOT / name)
    made = Project(tmp_path)
    made.store.save("actuator_calibration", Manifest(stage="actuator_calibration", entries=(), judged=()))
    monkeypatch.setattr(failure_modes, "PROJECT", made)
    return made


def test_a_trial_is_looked_at_once_and_again_when_a_threshold_changes(project, robot, tmp_path):
    (trial,) = trials_in(ROOT / "data/hardware_logs/demo/side_left_fall.mcap", robot)
    path = tmp_path / "trial.parquet"
    write_trial(path, trial)
    numbers = {"robot": "t1", "policy_digest": trial.policy_digest, "log": "side_left_fall"}
    first = failure_modes._findings("side_left_fall", path, numbers)
    report = TrialReport.from_dict(first["report"])
    assert first["new"] and [each.kind for each in report.failures if each.of_policy] == ["fall"]
    again = failure_modes._findings("side_left_fall", path, numbers)
    assert "new" not in again and again["report"] == first["report"]
    settings = tmp_path / "data/failures.yaml"
    text = settings.read_text()
    settings.unlink()
    settings.write_text(text.replace("tilt_deg: 60.0", "tilt_deg: 61.0"))
    assert failure_modes._findings("side_left_fall", path, numbers)["new"]


def test_the_page_shows_what_a_validation_missed_and_what_of_it_is_no_failure(project, robot, tmp_path):
    (trial,) = trials_in(ROOT / "data/hardware_logs/demo/side_left_fall.mcap", robot)
    span = {"cell": "vy -0.6", "from_s": 0.2, "until_s": 0.4}
    slip, power = ("slip", 0.2, 0.1), ("power", 133.0, 112.0)
    missed = tuple(MissedBar(figure=name, got=got, asked=asked, **span) for name, got, asked in (slip, power))
    path = tmp_path / "trial.parquet"
    write_trial(path, dataclasses.replace(trial, missed=missed))
    answer = failure_modes._findings("x", path, {"robot": "t1", "log": "x"})
    manifest = Manifest(stage="failure_modes", entries=(), judged=(), settings={"x": {"report": answer["report"]}})
    said = failure_modes._failure_metadata(manifest)
    assert "at most 0.1 m/s in the cell vy -0.6" in str(said["failures of all trials"].value)
    assert html.unescape(said[NOTED].md_str) == "- side_left_fall: vy -0.6: power 133, asked is at most 112 W"


def test_a_fault_of_ours_is_told_and_not_remembered(project, robot, tmp_path, monkeypatch):
    (trial,) = trials_in(ROOT / "data/hardware_logs/demo/side_left_fall.mcap", robot)
    path = tmp_path / "trial.parquet"
    write_trial(path, trial)
    numbers = {"robot": "t1", "log": "x"}
    with monkeypatch.context() as broken:
        broken.setattr(failure_modes, "find_failures", lambda *args, **given: 1 / 0)
        said = failure_modes._findings("x", path, numbers)
    assert said["fault"] and "ZeroDivisionError" in said["unread"]
    assert "report" in failure_modes._findings("x", path, numbers)


def test_a_store_that_cannot_be_read_or_written_is_no_unreadable_log(project, robot, tmp_path, monkeypatch):
    (trial,) = trials_in(ROOT / "data/hardware_logs/demo/side_left_fall.mcap", robot)
    path = tmp_path / "trial.parquet"
    write_trial(path, trial)
    numbers = {"robot": "t1", "log": "x"}
    (project.store.root / "memo").write_text("a file where a folder has to be")
    with pytest.raises(dg.DagsterUserCodeExecutionError, match=r"memo.*could not be read.*Check the disk"):
        failure_modes._findings("x", path, numbers)
    monkeypatch.setattr(Store, "recall", lambda *asked: None)
    with pytest.raises(dg.DagsterUserCodeExecutionError, match=r"memo.*could not be written.*MB are free"):
        failure_modes._findings("x", path, numbers)


def test_settings_and_a_calibration_that_cannot_be_read_are_no_unreadable_log(project, tmp_path):
    numbers = {"robot": "t1", "log": "x"}
    (tmp_path / "data/actuators.yaml").unlink()
    with pytest.raises(dg.DagsterUserCodeExecutionError, match=r"actuators\.yaml"):
        failure_modes._findings("x", tmp_path / "trial.parquet", numbers)
    (tmp_path / "data/actuators.yaml").symlink_to(ROOT / "data/actuators.yaml")
    project.store.manifest_path("actuator_calibration").write_text("{")
    with pytest.raises(dg.DagsterUserCodeExecutionError, match="actuator_calibration"):
        failure_modes._findings("x", tmp_path / "trial.parquet", numbers)


def test_what_cannot_be_looked_at_says_why(project, tmp_path):
    assert "no folder robots/k7" in failure_modes._findings("x", tmp_path, {"robot": "k7"})["unread"]
    broken = tmp_path / "broken.parquet"
    broken.write_bytes(b"no parquet")
    said = failure_modes._findings("x", broken, {"robot": "t1"})
    assert "not a trial" in said["unread"] and "fault" not in said
