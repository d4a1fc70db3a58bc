"""Figures of rollouts whose figures are known on paper."""

import numpy as np
import pytest

from pipeline.robot import Robot
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.figures import Measured, at_envelope, numbers_of
from pipeline.validation.trial import CommandProfile, Trial, VelocityCommand
from tests.factories.validation_walks import cell, gliding_rollout, measured


def _trial(wanted: VelocityCommand) -> Trial:
    return Trial(seed=0, command=CommandProfile(commands=(wanted,)), seconds=4.0, measure_s=1.0)


def _numbers(robot: Robot, velocity: tuple[float, float, float], wanted: VelocityCommand, **others) -> dict[str, float]:
    envelope = TorqueEnvelope(limit=robot.torque_limit)
    return numbers_of(gliding_rollout(robot, velocity, **others), _trial(wanted), envelope)


def test_velocity_is_that_of_the_heading_frame_on_a_curve(robot: Robot):
    found = _numbers(robot, (0.6, 0.1, 0.8), VelocityCommand(forward=0.6, lateral=0.1, yaw_rate=0.8))
    assert found["forward"] == pytest.approx(0.6, abs=2e-3)
    assert found["lateral"] == pytest.approx(0.1, abs=2e-3)
    assert found["yaw_rate"] == pytest.approx(0.8, abs=1e-6)
    assert found["speed_error"] == pytest.approx(0.0, abs=3e-3)


def test_errors_are_distances_to_the_last_command(robot: Robot):
    found = _numbers(robot, (0.9, 0.4, 0.0), VelocityCommand(forward=1.2, yaw_rate=-0.5))
    assert found["speed_error"] == pytest.approx(0.5, abs=1e-3)
    assert found["yaw_rate_error"] == pytest.approx(0.5, abs=1e-6)


def test_feet_that_slide_with_the_robot_slip_at_its_speed_and_set_down_never(robot: Robot):
    found = _numbers(robot, (0.5, 0.0, 0.0), VelocityCommand())
    assert found["slip"] == pytest.approx(0.5, abs=1e-3)
    assert found["drift"] == pytest.approx(1.5, abs=0.01)
    assert found["steps"] == 0.0


def test_power_is_the_sum_over_joints_without_sign(robot: Robot):
    found = _numbers(robot, (0.0, 0.0, 0.0), VelocityCommand(), torque=-2.0, joint_speed=1.5)
    assert found["power"] == pytest.approx(3.0 * len(robot.joint_names))


def test_saturation_counts_leg_joints_at_their_envelope(robot: Robot):
    # 15 N m is the limit of the two ankle rolls alone, of twelve leg joints
    assert _numbers(robot, (0.0, 0.0, 0.0), VelocityCommand(), torque=15.0)["saturation"] == pytest.approx(
        100.0 * 2 / 12
    )
    assert _numbers(robot, (0.0, 0.0, 0.0), VelocityCommand(), torque=14.9)["saturation"] == 0.0


def test_a_motor_beyond_its_no_load_speed_is_saturated_where_it_brakes_as_little_as_it_can():
    """Of 40 N m from standstill to 10 rad/s on, at 20 rad/s from -40 to -20 N m."""
    envelope = TorqueEnvelope(limit=np.array([40.0]), knee_speed=np.array([-5.0]), no_load_speed=np.array([15.0]))
    speed = np.full((4, 1), 25.0)
    assert envelope.bounds(speed)[1].ravel().tolist() == [-20.0] * 4
    torque = np.array([[-20.0], [-19.0], [-25.0], [-40.0]])
    assert at_envelope(torque, speed, envelope).ravel().tolist() == [True, True, False, True]
    assert at_envelope(-torque, -speed, envelope).ravel().tolist() == [True, True, False, True]


def test_of_a_fall_only_its_time_is_known(robot: Robot):
    assert _numbers(robot, (0.0, 0.0, 0.0), VelocityCommand(), fell_s=1.3) == {"fell": 1.0, "fell_s": 1.3}


def test_a_cells_figure_is_the_worst_of_those_that_stood():
    found = measured(cell("a", 3), {"speed_error": 0.1}, {"fell": 1.0, "fell_s": 2.0}, {"speed_error": 0.3})
    assert found.figure("falls") == 1.0
    assert found.figure("survival") == pytest.approx(2.0 / 3.0)
    assert found.figure("speed_error") == 0.3
    assert found.spread("speed_error") == pytest.approx({"mean": 0.2, "std": 0.1, "min": 0.1, "max": 0.3})
    assert found.fallen == (1,)


def test_where_all_fell_there_is_nothing_to_measure():
    found = Measured(cell=cell("a", 1), trials=({"fell": 1.0, "fell_s": 2.0},))
    assert found.figure("power") is None
    assert found.spread("power") == {}
