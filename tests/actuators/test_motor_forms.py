"""Box, DC-motor line and the envelope of our controller: the same torque for the same state. Logs against them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.actuators.adapted_robot import BoxLimits, JointActuator, adapt, dc_motor_line, torque_envelope
from pipeline.actuators.log_envelope import log_envelope
from pipeline.robot import Robot
from pipeline.simulation.torque_envelope import PdControl
from tests.factories.sweeps import SETTINGS


def mjlab_clip(effort, speed, effort_limit, saturation_effort, velocity_limit):
    """The formula that mjlab's and Isaac Lab's documentation give for their DC motor, written from it."""
    fastest = velocity_limit * (1.0 + effort_limit / saturation_effort)
    speed = np.clip(speed, -fastest, fastest)
    highest = np.minimum(saturation_effort * (1.0 - speed / velocity_limit), effort_limit)
    lowest = np.maximum(saturation_effort * (-1.0 - speed / velocity_limit), -effort_limit)
    return np.clip(effort, lowest, highest)


def actuator(torque: float, speed: float, no_load: float) -> JointActuator:
    box = BoxLimits(box_effort_limit=torque, box_velocity_limit=speed)
    numbers = dict.fromkeys((name for name in JointActuator.__dataclass_fields__), 0.0)
    named = {"joint": "knee", "motor": "knee", "verdict": ""}
    return JointActuator(**{**numbers, **named, **vars(box), **dc_motor_line(box, no_load)})


MOTORS = (actuator(60.0, 12.57, 15.71), actuator(25.0, 12.57, 15.0), actuator(7.0, 20.0, 40.0))


@given(
    asked=st.lists(st.floats(-500.0, 500.0), min_size=3, max_size=3),
    speed=st.lists(st.floats(-200.0, 200.0), min_size=3, max_size=3),
)
def test_our_controller_and_mjlabs_formula_give_the_same_torque_in_every_state(asked, speed):
    ours = torque_envelope(MOTORS).clip(np.array(asked), np.array(speed))
    theirs = mjlab_clip(
        np.array(asked),
        np.array(speed),
        np.array([each.dc_motor_effort_limit for each in MOTORS]),
        np.array([each.dc_motor_saturation_effort for each in MOTORS]),
        np.array([each.dc_motor_no_load_speed for each in MOTORS]),
    )
    np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_the_knee_speed_as_a_dc_motors_velocity_limit_would_leave_no_torque_at_the_knee():
    line = dc_motor_line(BoxLimits(box_effort_limit=60.0, box_velocity_limit=12.57), 15.7125)
    right = mjlab_clip(1e3, 12.57, 60.0, line["dc_motor_saturation_effort"], line["dc_motor_no_load_speed"])
    wrong = mjlab_clip(1e3, 12.57, 60.0, line["dc_motor_saturation_effort"], 12.57)
    assert right == pytest.approx(60.0) and wrong == pytest.approx(0.0)
    assert line["dc_motor_saturation_effort"] == pytest.approx(300.0)


def test_the_two_forms_share_no_name_and_a_line_needs_a_no_load_speed_above_the_knee():
    box = BoxLimits(box_effort_limit=60.0, box_velocity_limit=12.57)
    assert not set(vars(box)) & set(dc_motor_line(box, 15.7))
    with pytest.raises(ValueError, match="not above the knee"):
        dc_motor_line(box, 12.57)


def test_a_pd_controller_in_mujoco_obeys_the_envelope():
    control = PdControl(kp=np.full(3, 1e4), kd=np.zeros(3), envelope=torque_envelope(MOTORS))
    at_knee = control.torque(np.ones(3), np.zeros(3), np.array([12.57, 12.57, 20.0]))
    np.testing.assert_allclose(at_knee, [60.0, 25.0, 7.0])
    between = control.torque(np.ones(3), np.zeros(3), np.array([14.14, 13.785, 30.0]))
    np.testing.assert_allclose(between, [30.0, 12.5, 3.5])


def test_a_joint_without_measurements_keeps_its_torque_at_any_speed(robot: Robot):
    envelope = torque_envelope(adapt(robot, [], SETTINGS))
    lower, upper = envelope.bounds(np.full(23, 100.0))
    np.testing.assert_allclose(upper, robot.torque_limit, rtol=1e-6)
    np.testing.assert_allclose(lower, -robot.torque_limit, rtol=1e-6)


def log(samples: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Speeds and torques of the three motors, well inside their envelopes."""
    phase = np.linspace(0.0, 8.0 * np.pi, samples)[:, None]
    return np.sin(phase) * np.array([10.0, 9.0, 15.0]), np.cos(phase) * np.array([50.0, 20.0, 6.0])


def test_a_log_inside_the_limits_holds_and_its_reach_is_that_of_the_samples():
    speed, torque = log()
    found = log_envelope(MOTORS, speed, torque)
    assert all(each.holds for each in found)
    assert [each.max_speed for each in found] == pytest.approx([10.0, 9.0, 15.0], rel=1e-3)
    assert [np.nanmax(each.reached_torque) for each in found] == pytest.approx([50.0, 20.0, 6.0], rel=1e-2)


def test_torque_and_speed_beyond_the_limits_are_counted_and_braking_torque_is_not():
    speed, torque = log()
    speed[10, 1], speed[11, 1] = 14.0, -14.0
    torque[10, 1], torque[11, 1] = 24.0, 24.0  # driving at 14 rad/s, 10 N m are there; braking, all 25
    speed[20:23, 2] = 22.0
    torque[20:23, 2] = np.nan
    speed[30:32, 0], torque[30:32, 0] = 14.0, 0.0
    found = log_envelope(MOTORS, speed, torque)
    assert [each.over_torque for each in found] == [0, 1, 0]
    assert [each.over_speed for each in found] == [2, 2, 0]
    assert found[1].worst_torque_excess == pytest.approx((24.0 - 25.0 * 1.0 / 2.43) / 25.0)
    assert "1 of 400 samples give more torque" in found[1].text(400)


def test_a_log_of_the_opposite_motion_has_the_same_reach_and_the_same_excess():
    speed, torque = log()
    speed[40:45, 0], torque[40:45, 0] = 13.5, 55.0  # driving at 13.5 rad/s, 42 N m are there
    ahead, back = log_envelope(MOTORS, speed, torque), log_envelope(MOTORS, -speed, -torque)
    assert ahead[0].over_torque == back[0].over_torque == 5
    for one, other in zip(ahead, back, strict=True):
        assert one.worst_torque_excess == pytest.approx(other.worst_torque_excess)
        np.testing.assert_allclose(one.reached_torque, other.reached_torque, atol=0.01)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_what_brakes_is_no_torque_in_the_direction_of_motion(way: float):
    speed = way * np.tile([8.0, 8.0, 8.0], (50, 1))
    brakes = log_envelope(MOTORS, speed, -way * np.tile([30.0, 20.0, 5.0], (50, 1)))
    assert [np.nanmax(each.reached_torque) for each in brakes] == pytest.approx([-30.0, -20.0, -5.0])
    assert [each.max_torque for each in brakes] == pytest.approx([30.0, 20.0, 5.0])


def test_a_log_of_other_joints_is_refused():
    with pytest.raises(ValueError, match="of 3 joints"):
        log_envelope(MOTORS, np.zeros((5, 2)), np.zeros((5, 2)))
