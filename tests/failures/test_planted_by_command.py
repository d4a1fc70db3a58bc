"""Causes of stops that `booster-lab simulate-robot` plants, told apart from failures of the policy."""

import dataclasses

import pytest

from pipeline.cli.main import main
from pipeline.failures.failure import DAMPED, MOTORS_OFF
from pipeline.failures.find import find_failures
from tests.factories.log_trials import FAILURES, ROOT, trials_in
from tests.factories.trial_reports import proposal

LEG = "Left_Knee_Pitch,Left_Hip_Pitch,Left_Ankle_Pitch"
STAND, LEFT = "--command=0.5,0,0,0", "--command=0.5,0,0.4,0"


@pytest.fixture
def reported(tmp_path, robot, actuators, monkeypatch):
    """The report of the log that the command writes with some options."""
    monkeypatch.chdir(ROOT)

    def report(*options: str):
        path = tmp_path / "planted.mcap"
        assert main(["simulate-robot", str(path), *options]) == 0
        (trial,) = trials_in(path, robot)
        return find_failures(trial, robot, actuators, FAILURES)

    return report


def changes_of(report):
    """The changes that three recordings of such a trial propose."""
    return proposal(*(dataclasses.replace(report, sha256=f"{index:064x}") for index in range(3))).changes


@pytest.mark.parametrize(
    ("motors_off", "kind"),
    [("3,3.3", "motor_flicker"), ("3,3.6", "motor_flicker"), (f"3,end,{LEG}", "authority_loss")],
)
def test_motors_that_are_off_are_not_the_policys_failure(reported, capsys, motors_off, kind):
    report = reported("--script", "sway", STAND, "--seconds", "6", "--motors-off", motors_off)
    assert "motors off from 3 s to" in capsys.readouterr().out
    found = {each.kind: each for each in report.failures}
    assert found[kind].time_s == pytest.approx(3.0, abs=0.3)
    assert found[kind].excuse == MOTORS_OFF
    assert not any(each.of_policy for each in report.failures), [each.text() for each in report.failures]
    assert changes_of(report) == ()


def test_a_robot_that_is_damped_after_a_fall_proposes_what_its_fall_proposes(reported):
    report = reported("--script", "topple_left", LEFT, "--seconds", "8")
    (damped,) = [each for each in report.failures if each.kind == "damped"]
    assert damped.excuse == DAMPED and not damped.of_policy
    late = [each for each in report.failures if each.time_s >= damped.time_s]
    assert not any(each.of_policy for each in late), [each.text() for each in late]
    fall_alone = dataclasses.replace(report, failures=tuple(each for each in report.failures if each not in late))
    assert changes_of(report) == changes_of(fall_alone) != ()


@pytest.mark.parametrize("text", ["3", "3,2", "3,nan", "inf,end", "-1,2", "a,b", "3,,Left_Knee_Pitch", ""])
def test_an_outage_that_is_no_time_span_is_refused(capsys, text):
    assert main(["simulate-robot", "x.mcap", f"--motors-off={text}"]) == 2
    assert "is not T,UNTIL with 0 <= T < UNTIL [s]" in " ".join(capsys.readouterr().err.split())


def test_an_outage_of_an_unknown_joint_names_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    options = ["--script", "sway", "--seconds", "1", "--motors-off", "0.2,0.5,Left_Knee"]
    assert main(["simulate-robot", str(tmp_path / "x.mcap"), *options]) == 1
    assert "unknown joint 'Left_Knee'" in capsys.readouterr().err
    assert not (tmp_path / "x.mcap").exists()
