"""A walk in simulation beside a trial: its velocity, its gains and commands, and the cycles of the legs."""

import dataclasses

import numpy as np
import pytest

from pipeline import rotation
from pipeline.deployment import deployment_task
from pipeline.feedback.sim_to_real import _cycles, simulated, velocity_of
from pipeline.robot import Robot
from pipeline.simulation.record import Rollout
from pipeline.validation.limit_cycles import PLANES
from pipeline.virtual_robot.scripted import SWAY
from pipeline.virtual_robot.trial import VirtualTrial
from tests.factories.log_trials import nominal_actuators, scripted_log, trial_of
from tests.factories.policies import still_policy
from tests.factories.validation_walks import gliding_rollout


def test_a_robot_that_leans_turns_as_fast_as_its_heading_and_not_as_its_trunks_axis(robot: Robot):
    """.5 m/s ahead on a curve of .8 rad/s, the trunk leaning forward by .5 rad: about its own axis it turns slower."""
    count, step_s, rate, lean = 2000, 0.002, 0.8, 0.5
    time_s, joints = np.arange(count) * step_s, len(robot.joint_names)
    quat = rotation.multiply(
        rotation.from_rotvec(rate * time_s[:, None] * np.array([0.0, 0.0, 1.0])),
        rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), lean),
    )
    qpos = np.zeros((count, 7 + joints))
    qpos[:, 0], qpos[:, 1] = 0.5 / rate * np.sin(rate * time_s), 0.5 / rate * (1.0 - np.cos(rate * time_s))
    qpos[:, 2], qpos[:, 3:7] = 0.6, quat
    qvel = np.zeros((count, 6 + joints))
    qvel[:, 3:6] = rotation.rotate_inverse(quat, np.array([0.0, 0.0, rate]))
    ticks = count // 10
    rollout = Rollout(
        robot=robot,
        timestep_s=step_s,
        qpos=qpos,
        qvel=qvel,
        torque=np.zeros((count, joints)),
        foot_wrench_w=np.zeros((count, 2, 6)),
        command=np.zeros((ticks, 3)),
        target=np.zeros((ticks, joints)),
        fell_s=None,
    )
    assert qvel[0, 5] == pytest.approx(rate * np.cos(lean))
    assert velocity_of(rollout, 1.0, 3.0) == pytest.approx((0.5, 0.0, rate), abs=1e-3)


@pytest.fixture(scope="module")
def trial(robot: Robot):
    """A robot that sways; it is asked for other speeds from time to time."""
    command = ((0.5, 0.0, 0.0, 0.0), (1.0, 0.4, 0.0, 0.0), (1.6, 0.0, -0.2, 0.3))
    return trial_of(scripted_log(robot, SWAY, VirtualTrial(command=command, seconds=2.5)), robot)


def test_the_twin_has_the_gains_that_were_sent_and_the_commands_at_their_times(robot: Robot, trial):
    kp = np.where(np.isfinite(trial.kp), 1.3 * robot.kp, np.nan).astype(np.float32)
    kd = np.where(np.isfinite(trial.kd), 0.7 * robot.kd, np.nan).astype(np.float32)
    sent = dataclasses.replace(trial, kp=kp, kd=kd)
    policy = still_policy(deployment_task(robot))
    found = simulated(sent, robot, nominal_actuators(robot), policy, 2.2)
    targets = np.repeat(found.target, found.control_steps, axis=0)
    asked = 1.3 * robot.kp * (targets - found.qpos[:, 7:]) - 0.7 * robot.kd * found.qvel[:, 6:]
    free = np.abs(asked) < 0.9 * robot.torque_limit
    assert free.mean() > 0.9
    np.testing.assert_allclose(found.torque[free], asked[free], rtol=1e-5, atol=1e-4)
    for step in range(0, len(found.command), 7):
        at = int(np.argmin(np.abs(trial.time_s - step / 50.0)))
        np.testing.assert_allclose(found.command[step], np.nan_to_num(trial.command[at]), atol=1e-6)
    assert len(np.unique(found.command.round(6), axis=0)) >= 3


def test_the_cycles_of_a_trial_at_another_rate_are_those_of_its_twin(robot: Robot, trial):
    """Hips and knees of both turn in the same sines; those of the left leg of the trial are 1.5 times as large."""

    def swinging(time_s: np.ndarray, larger: float) -> tuple[np.ndarray, np.ndarray]:
        pos, vel = np.tile(robot.default_joint_pos, (len(time_s), 1)), np.zeros((len(time_s), len(robot.joint_names)))
        omega = 2.0 * np.pi / 0.8
        for name, size, lead in (("Hip_Pitch", 0.4, 0.0), ("Knee_Pitch", 0.3, 1.1)):
            for side, scale in (("Left", larger), ("Right", 1.0)):
                joint = robot.joint(f"{side}_{name}")
                pos[:, joint] += scale * size * np.cos(omega * time_s + lead)
                vel[:, joint] = -scale * size * omega * np.sin(omega * time_s + lead)
        return pos, vel

    glide = gliding_rollout(robot, (0.5, 0.0, 0.0), seconds=9.0)
    pos, vel = swinging(np.arange(len(glide.qpos)) * glide.timestep_s, 1.0)
    rollout = dataclasses.replace(
        glide,
        qpos=np.concatenate([glide.qpos[:, :7], pos], axis=1),
        qvel=np.concatenate([glide.qvel[:, :6], vel], axis=1),
    )
    rate_hz = 125.0
    pos, vel = (each.astype(np.float32) for each in swinging(np.arange(len(trial.time_s)) / rate_hz, 1.5))
    logged = dataclasses.replace(trial, rate_hz=rate_hz, joint_pos=pos, joint_vel=vel)
    notes: list[str] = []
    left, right = _cycles(logged, rollout, 2.0, 8.0, notes)
    assert notes == []
    for found, larger in ((left, 1.5), (right, 1.0)):
        assert found.period_ratio == pytest.approx(1.0, rel=1e-3)
        assert found.hip_amplitude_ratio == pytest.approx(larger, rel=0.01)
        assert found.knee_amplitude_ratio == pytest.approx(larger, rel=0.01)
        distance = (larger - 1.0) / np.sqrt((1.0 + larger**2) / 2.0)  # of a curve and a larger one of its shape
        assert [found.shape_distance[plane] for plane in PLANES] == pytest.approx([distance] * 3, abs=0.02)


def test_the_velocity_of_a_stretch_is_not_that_of_the_time_before_it(robot: Robot):
    glide = gliding_rollout(robot, (0.5, 0.0, 0.0))
    qpos = glide.qpos.copy()
    half = len(qpos) // 2
    qpos[:half, 0] = qpos[half, 0]
    stood = dataclasses.replace(glide, qpos=qpos)
    assert velocity_of(stood, 2.1, 3.9) == pytest.approx((0.5, 0.0, 0.0), abs=1e-6)
    assert velocity_of(stood, 0.1, 1.9) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
