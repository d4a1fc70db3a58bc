"""What a validation says of its simulated logs: told where no detector saw it, and believed of nothing else."""

from __future__ import annotations

import dataclasses
import json

import pytest

from pipeline.failures.failure import Failure
from pipeline.failures.find import find_failures
from pipeline.failures.signals import signals_of
from pipeline.failures.trial_report import missed_bars
from pipeline.hardware_logs import mcap_bytes
from pipeline.hardware_logs.missed_bars import NOTE, MissedBar, note_of
from pipeline.robot import Robot
from pipeline.virtual_robot.scripted import SWAY
from pipeline.virtual_robot.trial import VirtualTrial
from tests.factories.log_trials import FAILURES, scripted_log, trial_of
from tests.factories.trial_reports import proposal, values

SPAN = {"cell": "vx +0.6", "from_s": 2.0, "until_s": 6.0}
SLIP = MissedBar(figure="slip", got=0.102, asked=0.084, **SPAN)
SLOW = MissedBar(figure="speed_error", got=0.3, asked=0.2, axis="lateral", commanded=0.0, achieved=0.29, **SPAN)
TURNS = MissedBar(figure="yaw_rate_error", got=0.2, asked=0.1, axis="yaw", commanded=0.0, achieved=0.2, **SPAN)
DRIFTS = MissedBar(figure="drift", got=0.3, asked=0.1, axis="forward", commanded=0.0, achieved=0.05, **SPAN)
WEAK = MissedBar(figure="saturation", got=4.2, asked=3.9, joint="Left_Knee_Pitch", **SPAN)
THIRSTY = MissedBar(figure="power", got=183.0, asked=157.0, **SPAN)
STEPS = MissedBar(figure="steps", got=26.0, asked=4.0, **SPAN)
FELL = MissedBar(cell="push kick standing 40 Ns", figure="survival", got=0.875, asked=0.9, from_s=3.1, until_s=3.1)


@pytest.fixture(scope="module")
def log(robot):
    """A robot that stands and sways, told to stand: no detector finds anything in it."""
    return scripted_log(robot, SWAY, VirtualTrial(command=((0.0, 0.0, 0.0, 0.0),), seconds=6.0))


@pytest.fixture(scope="module")
def read_with(log, robot):
    """The trial in the log with a note, by way of its file."""

    def read(note: str, **facts):
        notes = {**log.facts.notes, NOTE: note}
        return trial_of(dataclasses.replace(log, facts=dataclasses.replace(log.facts, notes=notes, **facts)), robot)

    return read


def note(*missed: MissedBar) -> str:
    return note_of(missed)[NOTE]


def row(**changes) -> str:
    return json.dumps([{**dataclasses.asdict(SLIP), **changes}])


@pytest.mark.parametrize(
    ("bar", "kind", "direction", "joint"),
    [
        (SLIP, "slip", "", ""),
        (SLOW, "tracking", "lateral", ""),
        (TURNS, "tracking", "yaw", ""),
        (DRIFTS, "tracking", "forward", ""),
        (WEAK, "torque_saturation", "", "Left_Knee_Pitch"),
        (FELL, "fall", "", ""),
    ],
)
def test_a_missed_bar_is_a_failure_of_its_kind(standing, robot, actuators, bar, kind, direction, joint):
    assert find_failures(standing, robot, actuators, FAILURES).failures == ()
    (found,) = find_failures(dataclasses.replace(standing, missed=(bar,)), robot, actuators, FAILURES).failures
    assert (found.kind, found.direction, found.joint) == (kind, direction, joint)
    assert found.time_s == bar.from_s and found.until_s == pytest.approx(bar.until_s, abs=0.02)
    assert found.command_known and found.of_policy and 0.7 <= found.confidence <= 0.95
    assert (found.evidence["figure"], found.evidence["got"], found.evidence["asked"]) == (
        bar.figure,
        bar.got,
        bar.asked,
    )
    assert f"{bar.bar} in the cell {bar.cell}" in found.text()


def test_it_is_laid_to_the_command_of_that_time(standing, robot, actuators):
    command = standing.command.copy()
    command[standing.time_s >= 1.5] = (0.6, 0.0, -0.2)
    trial = dataclasses.replace(standing, command=command, missed=(SLIP,))
    (found,) = [each for each in find_failures(trial, robot, actuators, FAILURES).failures if each.kind == "slip"]
    assert found.command == pytest.approx((0.6, 0.0, -0.2))


def test_a_bar_that_is_missed_by_more_is_told_more_surely(standing, robot):
    def confidence(got: float) -> float:
        bar = dataclasses.replace(SLIP, got=got)
        (found,) = missed_bars(signals_of(dataclasses.replace(standing, missed=(bar,)), robot), [], 99.0)
        return found.confidence

    assert confidence(0.085) == pytest.approx(0.7, abs=0.01)
    assert confidence(0.085) < confidence(0.1) < confidence(0.2) == 0.95


def test_power_and_steps_are_noted_and_are_no_failure(standing, robot, actuators):
    report = find_failures(dataclasses.replace(standing, missed=(THIRSTY, STEPS)), robot, actuators, FAILURES)
    assert report.failures == ()
    assert sum("no kind of failure" in each for each in report.notes) == 2
    assert any("power 183, asked is at most 157 W" in each for each in report.notes)


def test_what_a_detector_found_then_is_not_told_twice(standing, robot):
    signals = signals_of(dataclasses.replace(standing, missed=(SLIP, SLOW, FELL)), robot)

    def seen(kind: str, start_s: float, until_s: float, direction: str = "") -> Failure:
        command = (0.0, 0.0, 0.0)
        return Failure(kind=kind, time_s=start_s, until_s=until_s, command=command, confidence=0.8, direction=direction)

    def told(*found: Failure) -> list[str]:
        return [each.kind for each in missed_bars(signals, found, 99.0)]

    assert told() == ["slip", "tracking", "fall"]
    assert told(seen("slip", 1.0, 2.5)) == ["tracking", "fall"]
    assert told(seen("slip", 0.5, 1.5)) == ["slip", "tracking", "fall"]  # at another time, under another command
    assert told(seen("tracking", 2.0, 5.0, "lateral")) == ["slip", "fall"]
    assert told(seen("tracking", 2.0, 5.0, "forward")) == ["slip", "tracking", "fall"]
    assert told(seen("fall", 4.0, 4.5)) == ["slip", "tracking"]


def test_two_figures_of_one_axis_are_one_failure(standing, robot):
    both = (dataclasses.replace(SLOW, axis="forward"), DRIFTS)
    assert len(missed_bars(signals_of(dataclasses.replace(standing, missed=both), robot), [], 99.0)) == 1


def test_nothing_is_told_of_times_that_the_trial_does_not_have_or_after_a_fall(standing, robot):
    later = dataclasses.replace(SLIP, from_s=7.0, until_s=9.0)
    assert missed_bars(signals_of(dataclasses.replace(standing, missed=(later,)), robot), [], 99.0) == []
    assert missed_bars(signals_of(dataclasses.replace(standing, missed=(SLIP,)), robot), [], 1.0) == []


def test_the_note_comes_back_from_a_log_as_it_was(read_with, robot, actuators):
    missed = (SLIP, SLOW, WEAK, THIRSTY, FELL)
    trial = read_with(note(*missed))
    assert trial.missed == missed and trial.notes == ()
    report = find_failures(trial, robot, actuators, FAILURES)
    assert sorted(each.kind for each in report.failures) == ["fall", "slip", "torque_saturation", "tracking"]
    assert report.simulated


def test_a_log_that_is_not_marked_simulated_is_not_believed(log, robot, actuators, read_with, standing):
    real = dataclasses.replace(standing, missed=(SLIP, FELL, THIRSTY), simulated=False)
    report = find_failures(real, robot, actuators, FAILURES)
    assert report.failures == () and report.notes == ()
    trial = read_with(note(SLIP, FELL), simulated=False)
    assert trial.missed == ()
    assert any("not that it is simulated" in each for each in trial.notes)
    assert find_failures(trial, robot, actuators, FAILURES).failures == ()


GARBAGE = ("", "[" * 5000, row(figure="temper"), row(got=float("nan")), row(got=10**400))
"""One of each way in which a note goes wrong; tests of logs have the others."""


@pytest.mark.parametrize("text", GARBAGE, ids=range(len(GARBAGE)))
def test_garbage_in_the_note_finds_nothing_and_stops_nothing(read_with, robot, actuators, text):
    trial = read_with(text)
    assert trial.simulated and trial.missed == ()
    assert trial.notes == ("its missed bars can't be right and are left out.",)
    assert find_failures(trial, robot, actuators, FAILURES).failures == ()


def test_equal_bars_are_equal_bytes(log):
    def written(notes: dict[str, str]) -> bytes:
        return mcap_bytes(dataclasses.replace(log, facts=dataclasses.replace(log.facts, notes=notes)))

    noted = {"reasons": "slip", **note_of((SLIP, SLOW))}
    assert written(noted) == written(dict(reversed(noted.items()))), "whatever the order they were put in"
    assert written(noted) != written({**noted, **note_of((SLOW, SLIP))})


def test_the_rules_propose_from_it_and_say_that_it_is_simulated(standing, robot: Robot, actuators):
    command = standing.command.copy()
    command[:] = (0.6, 0.0, 0.0)
    trial = dataclasses.replace(standing, command=command, policy_digest="a" * 64, missed=(SLIP, WEAK))
    report = find_failures(trial, robot, actuators, FAILURES, file="mujoco/vx_plus_0.6.mcap")
    report = dataclasses.replace(report, failures=tuple(each for each in report.failures if "bar" in each.evidence))
    found = proposal(report)
    moved = values(found)
    assert moved["randomization", "friction"] < 0.4
    assert any(section == "weights" and moved[section, what] > 1.0 for section, what in moved)
    assert not any(section == "motors" for section, _ in moved)  # a motor at its limit is no weaker motor
    for change in found.changes:
        (witness,) = change.witnesses
        assert witness.simulated and "(simulated)" in change.text() and "in the cell vx +0.6" in witness.said
