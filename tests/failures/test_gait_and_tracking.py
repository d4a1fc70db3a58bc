"""Slips, stumbles, divergence from the command, and the delay behind it, planted into signals."""

import dataclasses

import numpy as np
import pytest

from pipeline.failures.failure import Failure
from pipeline.failures.falls import slips, stumbles, windows_over
from pipeline.failures.find import find_failures
from pipeline.failures.signals import RobotMismatchError, signals_of
from pipeline.failures.tracking import delay_and_gain, tracking_divergences
from pipeline.files import settings
from tests.factories.log_trials import FAILURES

END_S = 99.0


def test_feet_that_slide_while_they_bear_are_a_slip(signals):
    slides = (signals.time_s > 2.0) & (signals.time_s < 4.0)
    speed = np.where(slides[:, None], 0.8, 0.0) * np.ones(2)
    (found,) = slips(dataclasses.replace(signals, sole_speed=speed), FAILURES.slip, END_S)
    assert found.evidence["fastest bearing sole [m/s]"] == pytest.approx(0.8)
    assert 0.5 < found.time_s < 3.0
    swings = dataclasses.replace(signals, sole_speed=speed, sole_height=np.full_like(signals.sole_height, 0.1))
    assert slips(swings, FAILURES.slip, END_S) == []
    skims = dataclasses.replace(signals, sole_speed=speed, support=np.full_like(signals.support, 0.05))
    assert slips(skims, FAILURES.slip, END_S) == [], "a foot that swings 5 mm over the ground carries nothing"


def test_a_window_at_the_end_is_as_long_as_any():
    mask = np.zeros(1000, dtype=bool)
    mask[-10:] = True
    assert windows_over(mask, 0.15, 2.0, 100.0) == []
    mask[-40:] = True
    assert windows_over(mask, 0.15, 2.0, 100.0) != []


def test_much_tilt_without_a_fall_is_a_stumble(signals):
    tilt = np.where((signals.time_s > 2.0) & (signals.time_s < 2.3), 25.0, 2.0)
    (found,) = stumbles(dataclasses.replace(signals, tilt_deg=tilt), FAILURES.stumble, END_S)
    assert found.time_s == pytest.approx(2.0, abs=0.02)
    assert stumbles(dataclasses.replace(signals, tilt_deg=tilt), FAILURES.stumble, 1.5) == []


@pytest.mark.parametrize(("achieved", "found"), [(0.95, 0), (0.4, 1)])
def test_a_walk_slower_than_commanded_is_told(signals, achieved, found):
    command = np.tile([1.0, 0.0, 0.0], (len(signals.time_s), 1))
    velocity = np.tile([achieved, 0.0], (len(signals.time_s), 1))
    walking = dataclasses.replace(signals, command=command, velocity=velocity)
    told = tracking_divergences(walking, FAILURES.tracking, END_S)
    assert len(told) == found
    for each in told:
        assert each.direction == "forward" and each.evidence["achieved"] == pytest.approx(achieved)


def test_a_command_that_changes_is_not_held_against_the_walk(signals):
    command = np.outer(0.3 * signals.time_s, [1.0, 0.0, 0.0])
    assert tracking_divergences(dataclasses.replace(signals, command=command), FAILURES.tracking, END_S) == []


@pytest.mark.parametrize("late", [0, 10, 25])
@pytest.mark.parametrize("gap", [0, 17])
def test_a_delay_of_the_targets_is_found_to_the_sample(standing, robot, late, gap):
    trial = dataclasses.replace(standing)
    moves = 0.1 * np.sin(2.0 * np.pi * 1.3 * trial.time_s + np.arange(len(trial.joint_names))[:, None]).T
    target = (trial.target_pos * 0.0 + moves).astype(np.float32)
    earlier = np.maximum(np.arange(len(target)) - late, 0)
    torque = trial.kp * (target[earlier] - trial.joint_pos) - trial.kd * trial.joint_vel
    torque[1000 : 1000 + gap] = np.nan  # samples that the log lost
    signals = signals_of(dataclasses.replace(trial, target_pos=target, torque_est=0.8 * torque), robot)
    delay, gain = delay_and_gain(signals, FAILURES.tracking, signals.at(1.0), signals.at(5.0))
    assert delay == pytest.approx(late / trial.rate_hz, abs=1e-9)
    assert gain == pytest.approx(0.8, rel=1e-3)


def test_without_a_sample_that_is_known_there_is_no_delay(standing, robot):
    lost = dataclasses.replace(standing, torque_est=np.full_like(standing.torque_est, np.nan))
    signals = signals_of(lost, robot)
    assert delay_and_gain(signals, FAILURES.tracking, signals.at(1.0), signals.at(5.0)) == (0.0, 1.0)


def test_a_log_that_does_not_say_what_was_asked_is_not_held_against_it(standing, robot, actuators):
    silent = dataclasses.replace(
        standing,
        command=np.full_like(standing.command, np.nan),
        command_source="unknown",
        kp=np.full_like(standing.kp, np.nan),
        kd=np.full_like(standing.kd, np.nan),
        target_pos=np.full_like(standing.target_pos, np.nan),
    )
    report = find_failures(silent, robot, actuators, FAILURES)
    assert report.failures == () and report.commands == () and not report.command_known
    assert any("the command is not known" in note for note in report.notes)
    assert any("no /joint_ctrl" in note for note in report.notes)


def test_a_trial_of_other_joints_is_refused(standing, robot):
    other = dataclasses.replace(standing, joint_names=tuple(reversed(standing.joint_names)))
    with pytest.raises(RobotMismatchError, match="23 joints"):
        signals_of(other, robot)


def test_a_failure_survives_its_json_form():
    failure = Failure(
        kind="fall",
        time_s=1.0,
        until_s=2.0,
        command=(0.1, 0.2, 0.3),
        confidence=0.9,
        evidence={"attitude": True, "x": 1.5},
    )
    assert Failure.from_dict(settings.plain(failure)) == failure
    assert "fall at 1.00 s" in failure.text() and "attitude yes" in failure.text()
