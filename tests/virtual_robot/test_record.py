"""A rollout as a log: what the sensors say, what is lost, and that the file says what it is."""

import dataclasses

import numpy as np
import pytest

from pipeline import rotation
from pipeline.hardware_logs import LogFacts, OperatorEvent, mcap_bytes
from pipeline.simulation.record import Rollout
from pipeline.virtual_robot.record import SOUND, HeatModel, record, roll_pitch_yaw, temperatures
from tests.factories.log_trials import trial_of

STEP_S = 0.002
QUIET = dataclasses.replace(
    SOUND,
    **dict.fromkeys(("attitude", "gyro", "acceleration", "joint_pos", "joint_vel", "torque_share", "torque"), 0.0),
    odometer_scale=0.8,
    odometer_drift=0.0,
    jitter_s=0.0,
    message_loss=0.0,
    motor_loss_hz=0.0,
)


def _rollout(robot, seconds=3.0, speed=0.5, tilt=None):
    """The robot glides forward in its default pose with a torque of a third of each limit."""
    count, joints = round(seconds / STEP_S), len(robot.joint_names)
    qpos, qvel = np.zeros((count, 7 + joints)), np.zeros((count, 6 + joints))
    qpos[:, 0] = speed * STEP_S * np.arange(count)
    qpos[:, 2] = 0.7
    qpos[:, 3:7] = rotation.IDENTITY if tilt is None else tilt
    qpos[:, 7:] = robot.default_joint_pos
    qvel[:, 0] = speed
    ticks = count // 10
    return Rollout(
        robot=robot,
        timestep_s=STEP_S,
        qpos=qpos,
        qvel=qvel,
        torque=np.tile(robot.torque_limit / 3.0, (count, 1)),
        foot_wrench_w=np.zeros((count, 2, 6)),
        command=np.tile([speed, 0.0, 0.0], (ticks, 1)),
        target=np.tile(robot.default_joint_pos, (ticks, 1)),
        fell_s=None,
        qacc=np.zeros((count, 6 + joints)),
    )


def _record(rollout, seed=0, quality=QUIET, **more):
    facts = LogFacts(robot=rollout.robot.name, policy_digest="ab" * 32, **more)
    return record(rollout, rollout.robot.kp, rollout.robot.kd, facts, np.random.default_rng(seed), quality=quality)


def test_the_reader_gets_back_what_happened(robot):
    rollout = _rollout(robot)
    trial = trial_of(_record(rollout, events=(OperatorEvent(time_s=1.0, kind="held"),)), robot)
    middle = slice(100, -100)
    assert trial.simulated and trial.integrity == "complete" and trial.policy_digest == "ab" * 32
    assert trial.command[middle] == pytest.approx(np.tile([0.5, 0.0, 0.0], (len(trial.command[middle]), 1)))
    assert trial.joint_pos[middle] == pytest.approx(
        np.tile(robot.default_joint_pos, (len(trial.joint_pos[middle]), 1)), abs=1e-6
    )
    assert trial.torque_est[middle] == pytest.approx(
        np.tile(robot.torque_limit / 3.0, (len(trial.torque_est[middle]), 1)), rel=1e-6
    )
    assert trial.acc_b[middle].mean(axis=0) == pytest.approx([0.0, 0.0, 9.81], abs=1e-3)
    assert np.nanmax(trial.kp, axis=0) == pytest.approx(robot.kp)
    walked = trial.odometer[-1, 0] - trial.odometer[0, 0]
    assert walked == pytest.approx(0.8 * 0.5 * 3.0, rel=0.02)
    assert [event.kind for event in trial.events] == ["held"]


def test_a_tilted_trunk_feels_gravity_along_its_own_axes(robot):
    tilt = rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.array(0.3))
    states = _record(_rollout(robot, speed=0.0, tilt=tilt)).low_state
    assert states.acc_b[0] == pytest.approx([-9.81 * np.sin(0.3), 0.0, 9.81 * np.cos(0.3)])
    assert states.rpy[0] == pytest.approx([0.0, 0.3, 0.0])


def test_angles_give_their_rotation_back():
    quats = rotation.normalize(np.random.default_rng(1).normal(size=(50, 4)))
    roll, pitch, yaw = roll_pitch_yaw(quats).T
    axes = np.eye(3)
    again = rotation.multiply(
        rotation.multiply(rotation.from_axis_angle(axes[2], yaw), rotation.from_axis_angle(axes[1], pitch)),
        rotation.from_axis_angle(axes[0], roll),
    )
    assert rotation.angle_between(quats, again) == pytest.approx(np.zeros(50), abs=1e-6)


def test_motors_warm_as_the_law_says(robot):
    rollout = _rollout(robot)
    knee = robot.joint("Left_Knee_Pitch")
    model = HeatModel(heating=40.0)
    found = temperatures(rollout, {"Left_Knee_Pitch": model})
    time_s = STEP_S * np.arange(len(found))

    def law(each: HeatModel) -> np.ndarray:
        end = each.ambient_c + each.rise_k * each.heating / 9.0
        return end + (each.start_c - end) * np.exp(-time_s / each.time_constant_s)

    assert found[:, knee] == pytest.approx(law(model), rel=1e-4)
    assert found[:, 0] == pytest.approx(law(HeatModel()), rel=1e-4)


def test_equal_seeds_give_equal_bytes_and_others_do_not(robot):
    rollout = _rollout(robot, seconds=0.6)
    noisy = [mcap_bytes(_record(rollout, seed, SOUND)) for seed in (1, 1, 2)]
    assert noisy[0] == noisy[1] != noisy[2]


def test_messages_and_packets_are_lost_as_often_as_is_said(robot):
    quality = dataclasses.replace(QUIET, message_loss=0.2, motor_loss_hz=5.0, jitter_s=0.0003)
    states = _record(_rollout(robot, seconds=8.0), quality=quality).low_state
    assert 1.0 - len(states.time_ns) / 4000 == pytest.approx(0.2, abs=0.03)
    assert states.lost[-1].mean() / 8.0 == pytest.approx(5.0, rel=0.15)
    assert (np.diff(states.lost, axis=0) >= 0).all() and (np.diff(states.time_ns) >= 0).all()


def test_one_state_in_so_many_can_be_logged(robot):
    rollout = _rollout(robot, seconds=1.0)
    facts = LogFacts(robot=robot.name)
    log = record(rollout, robot.kp, robot.kd, facts, np.random.default_rng(0), quality=QUIET, every=5)
    assert len(log.low_state.time_ns) == 100
    assert log.joint_ctrl is not None and len(log.joint_ctrl.time_ns) == 50


def test_the_robot_says_that_it_falls_and_then_that_it_has_fallen(robot):
    rollout = _rollout(robot)
    angle = np.clip((STEP_S * np.arange(len(rollout.qpos)) - 1.0) * 3.0, 0.0, 1.5)
    rollout.qpos[:, 3:7] = rotation.from_axis_angle(np.array([1.0, 0.0, 0.0]), angle)
    falls = _record(rollout).fall_down
    assert falls is not None
    assert sorted(set(falls.state.tolist())) == [0, 1, 2] and (np.diff(falls.state) >= 0).all()
