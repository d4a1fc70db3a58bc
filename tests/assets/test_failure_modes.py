"""Each trial is looked at once, and one that cannot be looked at stops no other."""

import pytest

from assets import failure_modes
from assets.project import Project
from pipeline.batch import Manifest
from pipeline.failures.trial_report import TrialReport
from pipeline.hardware_logs import write_trial
from tests.factories.log_trials import ROOT, trials_in


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
    first = failure_modes._answer("side_left_fall", path, numbers)
    report = TrialReport.from_dict(first["report"])
    assert first["new"] and [each.kind for each in report.failures if each.of_policy] == ["fall"]
    again = failure_modes._answer("side_left_fall", path, numbers)
    assert "new" not in again and again["report"] == first["report"]
    settings = tmp_path / "data/failures.yaml"
    text = settings.read_text()
    settings.unlink()
    settings.write_text(text.replace("tilt_deg: 60.0", "tilt_deg: 61.0"))
    assert failure_modes._answer("side_left_fall", path, numbers)["new"]


def test_what_cannot_be_looked_at_says_why(project, tmp_path):
    assert "no folder robots/k7" in failure_modes._answer("x", tmp_path, {"robot": "k7"})["unread"]
    broken = tmp_path / "broken.parquet"
    broken.write_bytes(b"no parquet")
    said = failure_modes._answer("x", broken, {"robot": "t1"})
    assert "not a trial" in said["unread"] and "fault" not in said
