"""Falls by attitude and by the robot's word, their direction and cause; hands and stops as excuses."""

import dataclasses

import numpy as np
import pytest

from pipeline.failures.failure import HELD, STOPPED, Failure
from pipeline.failures.falls import ATTITUDE_ALONE, BOTH, FLAG_ALONE, falls
from pipeline.failures.find import find_failures
from pipeline.failures.held import excuse_at, excuses
from pipeline.failures.signals import signals_of
from pipeline.files import settings
from pipeline.hardware_logs import OperatorEvent, Trial
from pipeline.robot import Robot
from pipeline.virtual_robot.scripted import SWAY, TOPPLE_LEFT, Hold
from pipeline.virtual_robot.trial import VirtualTrial
from tests.factories.log_trials import FAILURES, scripted_log, trial_of

FALL_S = 3.0


def _tipped(trial: Trial, roll: float, pitch: float, flagged: bool = True, until_s: float = 99.0) -> Trial:
    """The trial with a trunk that turns by these angles within half a second from `FALL_S` on."""
    part = np.clip((trial.time_s - FALL_S) / 0.5, 0.0, 1.0) * (trial.time_s < until_s)
    rpy = trial.rpy + np.outer(part, [roll, pitch, 0.0]).astype(np.float32)
    state = np.where(part > 0.5, 2, 0) if flagged else np.zeros(len(part), dtype=int)
    return dataclasses.replace(trial, rpy=rpy, fall_state=state)


def _falls(trial: Trial, robot: Robot) -> list[Failure]:
    return falls(signals_of(trial, robot), FAILURES.fall, (), FAILURES.excuse)


@pytest.mark.parametrize(
    ("roll", "pitch", "direction"),
    [(0.0, 1.5, "forward"), (0.0, -1.5, "backward"), (-1.5, 0.0, "left"), (1.5, 0.0, "right")],
)
def test_a_fall_is_found_with_its_direction_from_its_onset(standing, robot, roll, pitch, direction):
    (fall,) = _falls(_tipped(standing, roll, pitch), robot)
    assert fall.direction == direction
    assert FALL_S < fall.time_s < fall.until_s < FALL_S + 0.5
    assert fall.confidence == BOTH and fall.evidence["attitude"] is True and fall.of_policy


def test_who_saw_it_makes_the_confidence(standing, robot):
    (seen,) = _falls(_tipped(standing, 0.0, 1.5, flagged=False), robot)
    assert (seen.confidence, seen.evidence["robot says so"]) == (ATTITUDE_ALONE, False)
    said = dataclasses.replace(standing, fall_state=np.where(standing.time_s > FALL_S, 2, 0))
    (told,) = _falls(said, robot)
    assert (told.confidence, told.evidence["attitude"]) == (FLAG_ALONE, False)


def test_a_robot_that_lies_has_fallen_once_and_one_that_stood_up_may_fall_again(standing, robot):
    assert len(_falls(_tipped(standing, 0.0, 1.5), robot)) == 1
    stood = _tipped(standing, 0.0, 1.5, flagged=False, until_s=4.0)
    again = np.clip((stood.time_s - 5.0) / 0.3, 0.0, 1.0)
    twice = dataclasses.replace(stood, rpy=stood.rpy + np.outer(again, [0.0, 1.5, 0.0]).astype(np.float32))
    assert len(_falls(twice, robot)) == 2


def test_turning_half_round_is_no_fall(standing, robot):
    turned = np.stack([np.zeros_like(standing.time_s)] * 2 + [0.8 * standing.time_s], axis=1)
    wrapped = dataclasses.replace(standing, rpy=((standing.rpy + turned + np.pi) % (2 * np.pi) - np.pi).astype("f4"))
    assert _falls(wrapped, robot) == []


def test_a_standing_robot_bears_its_weight_and_one_that_hangs_does_not(standing, robot, actuators):
    borne = signals_of(standing, robot).support.sum(axis=1).mean()
    hold = Hold(start_s=2.0, stop_s=4.5)
    trial = VirtualTrial(command=((0.5, 0.0, 0.0, 0.0),), seconds=5.0, hold=hold)
    held = trial_of(scripted_log(robot, SWAY, trial), robot, "held")
    signals = signals_of(held, robot)
    hangs = signals.support[signals.at(3.0) : signals.at(4.0)].sum(axis=1).mean()
    assert borne > 0.6 and hangs < 0.1
    report = find_failures(held, robot, actuators, FAILURES)
    (found,) = [each for each in report.failures if each.kind == "held"]
    assert found.time_s < 3.2 and found.until_s > 4.0 and found.excuse == HELD


def test_a_fall_in_hands_is_not_the_policys(standing, robot, actuators):
    events = (OperatorEvent(time_s=2.5, kind="held"), OperatorEvent(time_s=4.0, kind="released"))
    held = dataclasses.replace(_tipped(standing, 0.0, 1.5), events=events)
    (fall,) = [each for each in find_failures(held, robot, actuators, FAILURES).failures if each.kind == "fall"]
    assert fall.excuse == HELD and not fall.of_policy


def test_a_fall_after_the_joints_were_only_damped_is_the_operators(standing, robot, actuators):
    kp = np.where((standing.time_s > 2.8)[:, None], 0.0, standing.kp).astype(np.float32)
    stopped = dataclasses.replace(_tipped(standing, 0.0, 1.5), kp=kp)
    found = find_failures(stopped, robot, actuators, FAILURES).failures
    (fall,) = [each for each in found if each.kind == "fall"]
    assert fall.excuse == STOPPED
    assert [each.kind for each in found if each.kind == "stopped"] == ["stopped"]


def test_joints_that_are_damped_because_it_falls_are_no_stop(standing, robot, actuators):
    tipped = _tipped(standing, 0.0, 1.5)
    kp = np.where((np.abs(tipped.rpy[:, 1]) > np.radians(60.0))[:, None], 0.0, standing.kp).astype(np.float32)
    found = find_failures(dataclasses.replace(tipped, kp=kp), robot, actuators, FAILURES).failures
    (fall,) = [each for each in found if each.kind == "fall"]
    assert fall.of_policy and "stopped" not in {each.kind for each in found}


def test_stiffness_that_is_not_known_for_a_moment_is_no_stop(standing, robot, actuators):
    lost = (standing.time_s > 1.0) & (standing.time_s < 1.02)
    kp = np.where(lost[:, None], np.nan, standing.kp).astype(np.float32)
    found = find_failures(dataclasses.replace(_tipped(standing, 0.0, 1.5), kp=kp), robot, actuators, FAILURES).failures
    (fall,) = [each for each in found if each.kind == "fall"]
    assert fall.of_policy and "stopped" not in {each.kind for each in found}


def test_where_the_command_is_lost_a_fall_is_of_no_command_and_nothing_is_steady(standing, robot, actuators):
    walked = np.where((standing.time_s > 2.0)[:, None], np.nan, np.array([0.0, 0.4, 0.0])).astype(np.float32)
    report = find_failures(dataclasses.replace(_tipped(standing, 0.0, 1.5), command=walked), robot, actuators, FAILURES)
    (fall,) = [each for each in report.failures if each.kind == "fall"]
    assert report.command_known and not fall.command_known and "command not known" in fall.text()
    assert all(command[:3] == pytest.approx((0.0, 0.4, 0.0)) for command in report.commands)
    restored = Failure.from_dict(settings.plain(fall))
    assert restored == fall


def test_what_a_robot_does_after_it_was_put_down_is_looked_at(standing, robot, actuators):
    events = (OperatorEvent(time_s=0.0, kind="held"), OperatorEvent(time_s=0.5, kind="released"))
    told = np.tile(np.array([1.0, 0.0, 0.0], dtype=np.float32), (len(standing.time_s), 1))
    report = find_failures(dataclasses.replace(standing, events=events, command=told), robot, actuators, FAILURES)
    (failed,) = [each for each in report.failures if each.kind == "tracking"]
    assert failed.of_policy and failed.time_s > 0.5 + FAILURES.excuse.after_s
    assert report.commands and report.commands[0][3] < 6.0 - 0.5 - FAILURES.excuse.after_s


def test_a_robot_that_lies_when_the_log_begins_did_not_fall_in_it(standing, robot):
    lying = 1.5 * np.clip((2.0 - standing.time_s) / 0.5, 0.0, 1.0)
    pitch = standing.rpy + np.outer(lying, [0.0, 1.0, 0.0]).astype(np.float32)
    state = np.where(lying > 0.5, 2, 0)
    risen = dataclasses.replace(standing, rpy=pitch, fall_state=state)
    assert _falls(risen, robot) == []
    again = 1.5 * np.clip((standing.time_s - 4.0) / 0.5, 0.0, 1.0)
    fallen = dataclasses.replace(risen, rpy=pitch + np.outer(again, [0.0, 1.0, 0.0]).astype(np.float32))
    (fall,) = _falls(fallen, robot)
    assert 4.0 < fall.time_s < 4.5


def test_long_after_it_was_let_go_a_failure_is_the_policys(standing, robot):
    events = (OperatorEvent(time_s=1.0, kind="held"), OperatorEvent(time_s=1.5, kind="released"))
    found = excuses(signals_of(dataclasses.replace(standing, events=events), robot), FAILURES.excuse)
    assert excuse_at(1.2, found, FAILURES.excuse) == HELD
    assert excuse_at(1.5 + FAILURES.excuse.after_s + 0.1, found, FAILURES.excuse) == ""


def test_a_simulated_robot_whose_leg_gives_way_falls_to_the_left_of_its_own(robot, actuators):
    trial = VirtualTrial(command=((0.5, 0.0, 0.4, 0.0),), seconds=5.0)
    fallen = trial_of(scripted_log(robot, TOPPLE_LEFT, trial), robot, "topple")
    report = find_failures(fallen, robot, actuators, FAILURES)
    (fall,) = [each for each in report.failures if each.of_policy]
    assert (fall.kind, fall.direction, fall.confidence) == ("fall", "left", BOTH)
    assert fall.command == pytest.approx((0.0, 0.4, 0.0))


def test_a_sound_trial_has_no_failures(standing, robot, actuators):
    report = find_failures(standing, robot, actuators, FAILURES)
    assert report.failures == ()
    ((forward, lateral, yaw, seconds),) = report.commands
    assert (forward, lateral, yaw) == (0.0, 0.0, 0.0) and seconds > 3.0
