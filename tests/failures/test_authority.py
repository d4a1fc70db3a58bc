"""Motors that do not answer and joints that are damped after a fall: told as such, and no failure of the policy."""

import dataclasses

import numpy as np
import pytest

from pipeline.failures.authority import damped_after, motor_outages
from pipeline.failures.failure import DAMPED, MOTORS_OFF, NOT_OF_POLICY
from pipeline.failures.find import find_failures
from pipeline.failures.signals import signals_of
from pipeline.feedback.propose import propose
from pipeline.virtual_robot.deviations import FailingMotors, Outage, joints_of, motor_envelope
from pipeline.virtual_robot.scripted import SWAY, TOPPLE_LEFT
from pipeline.virtual_robot.trial import VirtualTrial
from tests.factories.log_trials import FAILURES, scripted_log, trial_of
from tests.factories.trial_reports import COMMANDS, CURATION, RULES

KNEE = "Left_Knee_Pitch"


def outages(trial, robot, actuators):
    return motor_outages(signals_of(trial, robot), actuators, FAILURES.authority)


def silent(trial, robot, start_s: float, stop_s: float, error_rad: float = 0.5, share: float = 0.0):
    """The trial with a knee that is asked for torque all the time and gives so much of it from a time to another."""
    knee = robot.joint(KNEE)
    target, torque = trial.target_pos.copy(), trial.torque_est.copy()
    target[:, knee] = trial.joint_pos[:, knee] + error_rad
    asked = trial.kp[:, knee] * error_rad - trial.kd[:, knee] * trial.joint_vel[:, knee]
    off = (trial.time_s >= start_s) & (trial.time_s < stop_s)
    torque[:, knee] = np.where(off, share * asked, np.clip(asked, -60.0, 60.0))
    return dataclasses.replace(trial, target_pos=target, torque_est=torque)


@pytest.mark.parametrize("seconds", [0.3, 0.45, 0.6])
def test_a_motor_that_is_off_for_a_moment_flickers(standing, robot, actuators, seconds):
    (found,) = outages(silent(standing, robot, 2.0, 2.0 + seconds), robot, actuators)
    assert (found.kind, found.joint, found.excuse) == ("motor_flicker", KNEE, MOTORS_OFF)
    assert found.time_s == pytest.approx(2.0, abs=0.02)
    assert found.evidence["seconds"] == pytest.approx(seconds, abs=0.02)


def test_a_motor_that_stays_off_far_from_its_target_has_lost_authority(standing, robot, actuators):
    (found,) = outages(silent(standing, robot, 2.0, 99.0), robot, actuators)
    assert (found.kind, found.joint) == ("authority_loss", KNEE)
    assert found.evidence["from the target [rad]"] > 0.4
    assert not found.of_policy


@pytest.mark.parametrize(
    ("start_s", "stop_s", "error_rad", "share"),
    [(2.0, 2.1, 0.5, 0.0), (2.0, 99.0, 0.3, 0.0), (2.0, 99.0, 0.5, 0.4), (99.0, 99.0, 0.5, 0.0)],
    ids=["a tenth of a second", "near its target", "it gives two fifths", "it never is off"],
)
def test_what_is_no_outage_is_not_told(standing, robot, actuators, start_s, stop_s, error_rad, share):
    assert outages(silent(standing, robot, start_s, stop_s, error_rad, share), robot, actuators) == []


def test_without_commands_nothing_is_concluded(standing, robot, actuators):
    unknown = np.full_like(standing.kp, np.nan)
    trial = dataclasses.replace(silent(standing, robot, 2.0, 99.0), kp=unknown, kd=unknown, target_pos=unknown)
    assert outages(trial, robot, actuators) == []


def test_a_sound_walk_in_place_has_no_outage(standing, robot, actuators):
    assert outages(standing, robot, actuators) == []


@pytest.mark.parametrize(
    ("outage", "kind"),
    [
        (Outage(start_s=3.0, stop_s=3.5), "motor_flicker"),
        (Outage(start_s=3.0, joints=("Left_Knee_Pitch", "Left_Hip_Pitch", "Left_Ankle_Pitch")), "authority_loss"),
    ],
    ids=["flicker", "authority"],
)
def test_a_fall_by_motors_that_are_off_is_not_the_policys_and_proposes_nothing(robot, actuators, outage, kind):
    planted = VirtualTrial(command=((0.5, 0.0, 0.0, 0.0),), seconds=7.0, outages=(outage,))
    trial = trial_of(scripted_log(robot, SWAY, planted), robot)
    report = find_failures(trial, robot, actuators, FAILURES)
    found = {each.kind: each for each in report.failures}
    assert kind in found and found[kind].time_s == pytest.approx(3.0, abs=0.3)
    assert not any(each.of_policy for each in report.failures), [each.text() for each in report.failures]
    reports = [dataclasses.replace(report, sha256=f"{index:064x}") for index in range(3)]
    assert propose(reports, RULES, COMMANDS, CURATION.windows.bounds).changes == ()


def test_a_robot_that_is_damped_after_its_fall_fell_once(robot, actuators):
    planted = VirtualTrial(command=((0.5, 0.0, 0.0, 0.0),), seconds=8.0)
    trial = trial_of(scripted_log(robot, TOPPLE_LEFT, planted), robot)
    report = find_failures(trial, robot, actuators, FAILURES)
    (fall,) = [each for each in report.failures if each.kind == "fall"]
    (damped,) = [each for each in report.failures if each.kind == "damped"]
    assert fall.of_policy
    assert damped.excuse == DAMPED and not damped.of_policy
    assert damped.time_s > fall.time_s
    assert damped_after(signals_of(trial, robot), [], FAILURES.authority) == []


def test_an_outage_comes_as_often_as_it_is_planted(robot):
    count = len(robot.joint_names)
    outages = [Outage(start_s=start_s, stop_s=start_s + 0.4, joints=(KNEE,)) for start_s in (1.0, 2.0, 3.0)]
    motors = FailingMotors(
        kp=np.full(count, 10.0),
        kd=np.zeros(count),
        envelope=motor_envelope(robot),
        timestep_s=0.1,
        outages=tuple((outage, joints_of(robot, outage)) for outage in outages),
    )
    given = np.array([motors.torque(np.full(count, 0.1), np.zeros(count), np.zeros(count)) for _ in range(50)])
    off = given[:, robot.joint(KNEE)] == 0.0
    assert np.flatnonzero(np.diff(off.astype(int)) > 0).size == 3
    assert off.sum() == pytest.approx(12, abs=1)
    others = np.delete(given, robot.joint(KNEE), axis=1)
    assert (others == 1.0).all()
    assert outages[1].word() == f"motors off from 2 s to 2.4 s ({KNEE})"


def test_none_of_these_kinds_is_the_policys():
    assert {"damped", "motor_flicker", "authority_loss"} <= set(NOT_OF_POLICY)


def test_an_arm_that_is_off_excuses_no_fall(robot, actuators):
    arm = Outage(start_s=3.0, stop_s=3.5, joints=("Left_Elbow_Pitch", "Left_Shoulder_Roll"))
    planted = VirtualTrial(command=((0.5, 0.0, 0.0, 0.0),), seconds=7.0, outages=(arm,))
    trial = trial_of(scripted_log(robot, TOPPLE_LEFT, planted), robot)
    report = find_failures(trial, robot, actuators, FAILURES)
    (fall,) = [each for each in report.failures if each.kind == "fall"]
    assert fall.of_policy


@pytest.mark.parametrize(("silent_share", "found"), [(0.7, 1), (0.2, 0)])
def test_a_motor_need_not_be_asked_all_the_time_that_it_is_off(standing, robot, actuators, silent_share, found):
    """The knee is at its target in the middle of the outage; it gives nothing for a share of the shortest flicker."""
    shortest = FAILURES.authority.flicker_s[0]
    trial, half = silent(standing, robot, 2.0, 2.5), 0.5 * silent_share * shortest
    at_target = (trial.time_s >= 2.0 + half) & (trial.time_s < 2.5 - half)
    target, knee = trial.target_pos.copy(), robot.joint(KNEE)
    target[at_target, knee] = trial.joint_pos[at_target, knee]
    kinds = [each.kind for each in outages(dataclasses.replace(trial, target_pos=target), robot, actuators)]
    assert kinds == ["motor_flicker"] * found
