"""Plateaus of torque, speeds, heat and losses, planted into a sound trial."""

import dataclasses

import numpy as np
import pytest

from pipeline.failures.motors import hot_motors, lost_packets, speed_saturations, torque_saturations
from pipeline.failures.signals import signals_of
from pipeline.hardware_logs import Gap
from tests.factories.log_trials import FAILURES

KNEE = "Left_Knee_Pitch"
END_S = 99.0


def _with_torque(trial, robot, given, swing=0.4):
    """The trial with a knee whose targets swing by so many rad and that gives what `given` makes of what is asked."""
    knee = robot.joint(KNEE)
    swings = swing * np.sin(2.0 * np.pi * 1.2 * trial.time_s)
    target, torque = trial.target_pos.copy(), trial.torque_est.copy()
    target[:, knee] = trial.joint_pos[:, knee] + swings
    asked = trial.kp[:, knee] * swings - trial.kd[:, knee] * trial.joint_vel[:, knee]
    noise = np.random.default_rng(0).normal(0.0, 0.3, len(asked))
    torque[:, knee] = given(np.nan_to_num(asked)) + noise
    return dataclasses.replace(trial, target_pos=target, torque_est=torque)


@pytest.mark.parametrize("limit", [20.0, 36.0, 50.0])
def test_a_motor_that_never_gives_more_is_found_with_its_limit(standing, robot, actuators, limit):
    weak = _with_torque(standing, robot, lambda asked: np.clip(asked, -limit, limit))
    (found,) = torque_saturations(signals_of(weak, robot), actuators, FAILURES.torque, END_S)
    assert found.joint == KNEE and found.evidence["weaker than calibrated"] is True
    assert found.evidence["given_n_m"] == pytest.approx(limit, rel=0.02)
    assert found.evidence["limit_n_m"] == 60.0


def test_a_soft_gain_is_no_plateau(standing, robot, actuators):
    soft = _with_torque(standing, robot, lambda asked: 0.4 * asked)
    assert torque_saturations(signals_of(soft, robot), actuators, FAILURES.torque, END_S) == []


def test_a_motor_that_gives_what_it_is_asked_saturates_nowhere(standing, robot, actuators):
    strong = _with_torque(standing, robot, lambda asked: np.clip(asked, -1e3, 1e3))
    found = torque_saturations(signals_of(strong, robot), actuators, FAILURES.torque, END_S)
    assert [each for each in found if each.joint == KNEE] == []


def test_its_own_calibrated_limit_is_a_failure_only_for_a_large_share(standing, robot, actuators):
    sometimes = _with_torque(standing, robot, lambda asked: np.clip(asked, -60.0, 60.0), swing=0.22)
    share = FAILURES.torque.nominal_share
    for bound, count in ((share, 0), (0.2, 1)):
        values = dataclasses.replace(FAILURES.torque, nominal_share=bound)
        found = torque_saturations(signals_of(sometimes, robot), actuators, values, END_S)
        assert len([each for each in found if each.joint == KNEE]) == count


def test_a_plateau_that_is_exceeded_elsewhere_is_none(standing, robot, actuators):
    def given(asked: np.ndarray) -> np.ndarray:
        late = np.arange(len(asked)) > 0.9 * len(asked)
        return np.where(late, np.clip(asked, -60.0, 60.0), np.clip(asked, -36.0, 36.0))

    mixed = _with_torque(standing, robot, given)
    found = torque_saturations(signals_of(mixed, robot), actuators, FAILURES.torque, END_S)
    assert [each for each in found if each.evidence["weaker than calibrated"]] == []


def test_a_joint_faster_than_its_motor_is_told_with_its_speed(standing, robot, actuators):
    knee, speed = robot.joint(KNEE), standing.joint_vel.copy()
    fast = (standing.time_s % 1.0) < 0.3
    speed[fast, knee] = 14.0
    signals = signals_of(dataclasses.replace(standing, joint_vel=speed), robot)
    (found,) = speed_saturations(signals, actuators, FAILURES.speed, END_S)
    assert found.joint == KNEE and found.evidence["fastest [rad/s]"] == pytest.approx(14.0)
    assert speed_saturations(signals_of(standing, robot), actuators, FAILURES.speed, END_S) == []


def test_a_hot_motor_is_told_and_one_reading_is_not(standing, robot):
    hot, once = standing.temperature_c.copy(), standing.temperature_c.copy()
    hot[standing.time_s > 3.0, 5] = 80.0
    once[100, 5] = 80.0
    (found,) = hot_motors(signals_of(dataclasses.replace(standing, temperature_c=hot), robot), FAILURES.heat)
    assert found.joint == robot.joint_names[5] and found.time_s == pytest.approx(3.0, abs=0.01)
    assert hot_motors(signals_of(dataclasses.replace(standing, temperature_c=once), robot), FAILURES.heat) == []


def test_lost_packets_and_silence_are_told(standing, robot):
    lost = standing.lost.copy()
    lost[standing.time_s > 3.0, 7] += (20.0 * (standing.time_s[standing.time_s > 3.0] - 3.0)).astype(int)
    (found,) = lost_packets(signals_of(dataclasses.replace(standing, lost=lost), robot), FAILURES.packets)
    assert found.joint == robot.joint_names[7]
    assert found.evidence["packets lost a second"] == pytest.approx(20.0, rel=0.15)
    silent = dataclasses.replace(standing, gaps=(Gap(start_s=2.0, stop_s=2.3, reason="no message"),))
    told = lost_packets(signals_of(silent, robot), FAILURES.packets)
    assert [each.evidence["silence [s]"] for each in told] == pytest.approx([0.3])
    assert lost_packets(signals_of(standing, robot), FAILURES.packets) == []
