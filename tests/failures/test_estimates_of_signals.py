"""What is estimated from a log's sensors against motions whose velocities are known."""

import dataclasses

import numpy as np
import pytest

from pipeline import rotation
from pipeline.failures.authority import leg_joints
from pipeline.failures.failure import HELD
from pipeline.failures.falls import FIRM_S, standing_feet, stumbles
from pipeline.failures.held import excuses
from pipeline.failures.motors import asked_torque, lost_packets
from pipeline.failures.signals import signals_of
from pipeline.hardware_logs import Trial
from pipeline.robot import Kinematics, Robot
from tests.factories.log_trials import FAILURES

INNER = slice(125, -125)
"""Without a second at either end, where filters see what is beyond."""


def _at_rest(trial: Trial, robot: Robot, **others: np.ndarray) -> Trial:
    """The trial with the default pose all along, upright, at rest, and other arrays in their place."""
    count = len(trial.time_s)
    arrays = {
        "joint_pos": np.tile(robot.default_joint_pos, (count, 1)),
        "joint_vel": np.zeros((count, len(robot.joint_names))),
        "rpy": np.zeros((count, 3)),
        "gyro_b": np.zeros((count, 3)),
        "acc_b": np.tile([0.0, 0.0, 9.81], (count, 1)),
    }
    return dataclasses.replace(trial, **{name: each.astype(np.float32) for name, each in (arrays | others).items()})


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_soles_of_a_robot_that_glides_move_as_its_accelerometer_says(standing, robot, yaw):
    """A sine of 2 m/s² at 2 Hz is one of 0.16 m/s; joints that do not move say nothing of it."""
    omega, along = 4.0 * np.pi, np.array([0.6, 0.8, 0.0])
    time_s, count = standing.time_s, len(standing.time_s)
    force_w = 2.0 * np.sin(omega * time_s)[:, None] * along + np.array([0.0, 0.0, 9.81])
    acc_b = rotation.rotate_inverse(rotation.about_z(np.full(count, yaw)), force_w)
    glides = _at_rest(standing, robot, acc_b=acc_b, rpy=np.tile([0.0, 0.0, yaw], (count, 1)))
    signals = signals_of(glides, robot)
    speed = 2.0 / omega * np.abs(np.cos(omega * signals.time_s))
    np.testing.assert_allclose(signals.sole_speed[INNER], np.stack([speed, speed], axis=1)[INNER], atol=0.02)


def test_soles_stand_while_the_trunk_sways_over_them(standing, robot):
    """A trunk that turns about the soles' centre with rigid legs moves; the soles do not."""
    time_s, omega, size = standing.time_s, 4.0 * np.pi, 0.02
    height = -Kinematics(robot).sites_of_pose([robot.sole_corners[0][0]], robot.default_joint_pos)[0, 2]
    pitch = size * np.sin(omega * time_s)
    rpy = np.stack([np.zeros_like(pitch), pitch, np.zeros_like(pitch)], axis=1)
    turn = rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), pitch)
    way_w = height * np.stack([np.sin(pitch), np.zeros_like(pitch), np.cos(pitch)], axis=1)
    force_w = np.gradient(np.gradient(way_w, time_s, axis=0), time_s, axis=0) + np.array([0.0, 0.0, 9.81])
    signals = signals_of(_at_rest(standing, robot, rpy=rpy, acc_b=rotation.rotate_inverse(turn, force_w)), robot)
    trunk_m_s = size * omega * height
    assert trunk_m_s > 0.15
    assert np.abs(signals.velocity[INNER, 0]).max() == pytest.approx(trunk_m_s, rel=0.15)
    assert np.percentile(signals.sole_speed[INNER], 90) < 0.25 * trunk_m_s


@pytest.mark.parametrize("rate", [0.8, -0.5])
def test_the_yaw_rate_is_that_of_the_attitude(standing, robot, rate):
    yaw = np.angle(np.exp(1j * rate * standing.time_s))
    turning = _at_rest(standing, robot, rpy=np.stack([0.0 * yaw, 0.0 * yaw, yaw], axis=1))
    np.testing.assert_allclose(signals_of(turning, robot).yaw_rate[INNER], rate, atol=0.01)


def test_the_attitude_is_roll_after_pitch_after_yaw(standing, robot):
    """The vertical of R = Rz Ry Rx in the trunk's frame, at angles large enough to tell the order."""
    roll, pitch, yaw = 0.5, -0.4, 1.2
    tilted = _at_rest(standing, robot, rpy=np.tile([roll, pitch, yaw], (len(standing.time_s), 1)))
    (cr, cp), (sr, sp) = np.cos([roll, pitch]), np.sin([roll, pitch])
    signals = signals_of(tilted, robot)
    np.testing.assert_allclose(signals.lean_b[100], [sp, -cp * sr], atol=1e-6)
    np.testing.assert_allclose(signals.tilt_deg[100], np.degrees(np.arccos(cp * cr)), atol=1e-4)
    np.testing.assert_allclose(tilted.gravity_b[100], [sp, -cp * sr, -cp * cr], atol=1e-6)


def test_a_robot_at_rest_feels_gravity_and_one_that_falls_freely_nothing(standing, robot):
    assert signals_of(_at_rest(standing, robot), robot).specific_force == pytest.approx(1.0, abs=1e-3)
    falls = _at_rest(standing, robot, acc_b=np.zeros((len(standing.time_s), 3)))
    assert signals_of(falls, robot).specific_force == pytest.approx(0.0, abs=1e-9)


def test_forward_torque_adds_to_what_is_asked(signals):
    trial = signals.trial
    more = dataclasses.replace(trial, target_torque=np.nan_to_num(trial.target_torque) + np.float32(5.0))
    without = dataclasses.replace(trial, target_torque=np.zeros_like(trial.target_torque))
    added = asked_torque(dataclasses.replace(signals, trial=more))
    before = asked_torque(dataclasses.replace(signals, trial=without))
    known = np.isfinite(added)
    assert known.any()
    np.testing.assert_allclose((added - before)[known], 5.0, atol=1e-4)


@pytest.mark.parametrize("window_s", [0.5, 1.0, 2.0])
def test_packets_lost_a_second_do_not_depend_on_the_window(standing, robot, window_s):
    lost = standing.lost.copy()
    lost[:, 7] += (20.0 * standing.time_s).astype(int)
    watched = dataclasses.replace(FAILURES.packets, window_s=window_s)
    (found,) = lost_packets(signals_of(dataclasses.replace(standing, lost=lost), robot), watched)
    assert found.evidence["packets lost a second"] == pytest.approx(20.0, rel=0.05)


@pytest.mark.parametrize(("each_foot", "held"), [(0.15, False), (0.05, True)])
def test_a_robot_that_hangs_is_one_that_neither_foot_bears(signals, each_foot, held):
    """0.3 of the weight on both feet together is more than the bound, though neither bears so much."""
    assert 0.1 < FAILURES.excuse.support < 0.3
    count = len(signals.time_s)
    borne = dataclasses.replace(
        signals,
        support=np.full((count, 2), each_foot),
        specific_force=np.ones(count),
        tilt_deg=np.zeros(count),
    )
    assert [each.why for each in excuses(borne, FAILURES.excuse)] == [HELD] * held


def test_a_foot_that_has_just_landed_or_is_about_to_leave_does_not_stand_firmly(signals):
    count, fps = len(signals.time_s), signals.fps
    height = np.full((count, 2), 0.05)
    height[200:300, 0] = height[400:410, 1] = 0.0
    firm = standing_feet(dataclasses.replace(signals, sole_height=height, support=np.ones((count, 2))))
    margin = round(FIRM_S * fps)
    assert np.flatnonzero(firm[:, 0]).tolist() == list(range(200 + margin, 300 - margin))
    assert not firm[:, 1].any()


@pytest.mark.parametrize(("axis", "count"), [(0, 1), (1, 1), (2, 0)])
def test_a_fast_turn_about_the_vertical_is_no_stumble(standing, robot, axis, count):
    gyro = np.zeros_like(standing.gyro_b)
    gyro[(standing.time_s > 2.0) & (standing.time_s < 2.5), axis] = 1.5 * FAILURES.stumble.rate
    signals = signals_of(_at_rest(standing, robot, gyro_b=gyro), robot)
    assert len(stumbles(signals, FAILURES.stumble, 99.0)) == count


def test_joints_of_legs_are_those_of_both_legs(robot):
    names = {robot.joint_names[joint] for joint in leg_joints(robot)}
    wanted = {name for name in robot.joint_names if any(part in name for part in ("Hip", "Knee", "Ankle"))}
    assert wanted <= names
    assert names - wanted <= {"Waist"}
